"""numpy's .npz: `vertices` (T, V, 3) float32, `codes` (T, H) int64, `fps` ().

Several faces have a first axis more. Where a face has several parts, `parts` and `codes_per_part`
say which columns of the codes belong to which.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterable, Sequence
from typing import BinaryIO

import numpy as np

from facecode.arrays import AnyArray
from facecode.clip import Clip
from facecode.writers.format import Format


def write_npz(clip: Clip, file: BinaryIO, progress: bool = False) -> None:  # noqa: ARG001
    """Write a clip to an open binary file; too quick for `progress`."""
    _write(file, clip, clip.offsets + clip.template, clip.codes)


def write_blocks_npz(face: Clip, n_frames: int, blocks: Iterable[Clip], file: BinaryIO) -> None:
    """Write a clip that comes in blocks: the bytes of `write_npz`, in the memory of a block."""
    codes = [face.codes[:0]]
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
        with archive.open("vertices.npy", "w", force_zip64=True) as member:
            header = {"descr": "<f4", "fortran_order": False}
            shape = (n_frames, *face.template.shape)
            np.lib.format.write_array_header_1_0(member, header | {"shape": shape})
            for block in blocks:
                codes.append(block.codes)
                member.write(np.ascontiguousarray(block.vertices, "<f4").data)
        for name, array in _numbers(face, np.concatenate(codes)).items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asarray(array), allow_pickle=False)


def write_takes_npz(clips: Sequence[Clip], file: BinaryIO, progress: bool = False) -> None:  # noqa: ARG001
    """Write several faces of one recording: `vertices` (K, T, V, 3), `codes` (K, T, H)."""
    vertices = np.stack([clip.offsets + clip.template for clip in clips])
    _write(file, clips[0], vertices, np.stack([clip.codes for clip in clips]))


def _write(file: BinaryIO, first: Clip, vertices: AnyArray, codes: AnyArray) -> None:
    np.savez(file, allow_pickle=False, vertices=vertices, **_numbers(first, codes))


def _numbers(face: Clip, codes: AnyArray) -> dict[str, AnyArray]:
    """All arrays but the vertices."""
    arrays: dict[str, AnyArray] = {"codes": codes, "fps": np.asarray(np.float64(face.fps))}
    if len(face.parts) > 1:
        arrays["parts"] = np.array(list(face.parts))
        arrays["codes_per_part"] = np.array(list(face.parts.values()))
    return arrays


NPZ = Format(".npz", write_npz, write_takes_npz, write_blocks_npz)
