"""Live Link Face's .csv: ARKit weights, one row a frame, as the app writes a take.

Comes in: a clip with ARKit-named units, whole or block by block. Goes out: UTF-8 text with LF. The
timecode counts 60 frames a second whatever the rate of the take: importers take it so, and a file
that counts 30 plays in half of each second. Rotations of head and eyes, which the codes do not
hold, are 0.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import BinaryIO

from facecode.clip import Clip
from facecode.writers.arkit import NAMES, columns, in_order, pascal
from facecode.writers.format import Format, of_blocks

ROTATIONS = tuple(
    f"{what}{axis}" for what in ("Head", "LeftEye", "RightEye") for axis in ("Yaw", "Pitch", "Roll")
)
N_COLUMNS = len(NAMES) + len(ROTATIONS)
HEADER = ",".join(["Timecode", "BlendShapeCount", *map(pascal, NAMES), *ROTATIONS])
BASE = 60
"""Frames a second of the timecode."""
STILL = ",0.0000000000" * len(ROTATIONS)


def write_blocks_csv(face: Clip, n_frames: int, blocks: Iterable[Clip], file: BinaryIO) -> None:
    """Write a header and a row for each frame to an open binary file, which need not seek.

    Raises:
        NoRigError: the face units are not known.
        UnitNamesError: the rig has no unit of ARKit's.
    """
    del n_frames
    found = columns(face.weight_names, ".csv")
    file.write(f"{HEADER}\n".encode())
    index = 0
    for block in blocks:
        for row in in_order(block.weights, found).tolist():
            values = ",".join(f"{value:.10f}" for value in row)
            line = f"{timecode(index, face.fps)},{N_COLUMNS},{values}{STILL}\n"
            file.write(line.encode())
            index += 1


def timecode(index: int, fps: float) -> str:
    """`HH:MM:SS:FF.mmm` of frame `index` at `fps` a second, FF of 60, mmm a share of one."""
    seconds, thousandths = divmod(round(index * 1000 * BASE / fps), 1000 * BASE)
    minutes, seconds = divmod(seconds, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours:02d}:{minutes:02d}:{seconds:02d}:{thousandths / 1000:06.3f}"


CSV = Format(
    ".csv",
    of_blocks(write_blocks_csv),
    write_blocks=write_blocks_csv,
    needs_rig=True,
    needs_vertices=False,
)
