"""Point caches: every vertex of every frame, for a mesh of the same order (`facecode mesh`).

.pc2 (3ds Max's, little endian) and .mdd (LightWave's, big endian). Comes in: a clip, whole or
block by block. Goes out: positions in metres, y up. Both need nothing but vertices.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import BinaryIO

import numpy as np

from facecode.clip import Clip
from facecode.writers.format import Format, of_blocks
from facecode.writers.space import metres_y_up

PC2_HEADER = struct.Struct("<12siiffi")
PC2_MAGIC, PC2_VERSION = b"POINTCACHE2\0", 1
MDD_HEADER = struct.Struct(">ii")


def write_blocks_pc2(face: Clip, n_frames: int, blocks: Iterable[Clip], file: BinaryIO) -> None:
    """Write a .pc2, frame 0 first, one sample a frame; `file` need not seek."""
    first_frame, frames_per_sample = 0.0, 1.0
    file.write(
        PC2_HEADER.pack(
            PC2_MAGIC, PC2_VERSION, len(face.template), first_frame, frames_per_sample, n_frames
        )
    )
    _write_points(blocks, "<f4", file)


def write_blocks_mdd(face: Clip, n_frames: int, blocks: Iterable[Clip], file: BinaryIO) -> None:
    """Write a .mdd with the time of each frame in seconds; `file` need not seek."""
    file.write(MDD_HEADER.pack(n_frames, len(face.template)))
    file.write((np.arange(n_frames) / face.fps).astype(">f4").tobytes())
    _write_points(blocks, ">f4", file)


def _write_points(blocks: Iterable[Clip], dtype: str, file: BinaryIO) -> None:
    for block in blocks:
        for offsets in block.offsets:
            points = metres_y_up(block, offsets + block.template)
            file.write(points.astype(dtype).tobytes())


PC2 = Format(".pc2", of_blocks(write_blocks_pc2), write_blocks=write_blocks_pc2)
MDD = Format(".mdd", of_blocks(write_blocks_mdd), write_blocks=write_blocks_mdd)
