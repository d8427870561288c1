"""numpy's .npz: `vertices` (T, V, 3) float32, `codes` (T, H) int64, `fps` ().

Several faces have a first axis more. Where a face has several parts, `parts` and `codes_per_part`
say which columns of the codes belong to which.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import BinaryIO

import numpy as np

from facecode.arrays import AnyArray
from facecode.clip import Clip
from facecode.writers.format import Format


def write_npz(clip: Clip, file: BinaryIO, progress: bool = False) -> None:  # noqa: ARG001
    """Write a clip to an open binary file; too quick for `progress`."""
    _write(file, clip, clip.offsets + clip.template, clip.codes)


def write_takes_npz(clips: Sequence[Clip], file: BinaryIO, progress: bool = False) -> None:  # noqa: ARG001
    """Write several faces of one recording: `vertices` (K, T, V, 3), `codes` (K, T, H)."""
    vertices = np.stack([clip.offsets + clip.template for clip in clips])
    _write(file, clips[0], vertices, np.stack([clip.codes for clip in clips]))


def _write(file: BinaryIO, first: Clip, vertices: AnyArray, codes: AnyArray) -> None:
    arrays = {"vertices": vertices, "codes": codes, "fps": np.float64(first.fps)}
    if len(first.parts) > 1:
        arrays["parts"] = np.array(list(first.parts))
        arrays["codes_per_part"] = np.array(list(first.parts.values()))
    np.savez(file, allow_pickle=False, **arrays)


NPZ = Format(".npz", write_npz, write_takes_npz)
