"""numpy's .npz: `vertices` (T, V, 3) float32, `codes` (T, H) int64, `fps` ().

Several faces have a first axis more. Where a face has several parts, `parts` and `codes_per_part`
say which columns of the codes belong to which.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

import numpy as np

if TYPE_CHECKING:
    from facecode.animation import Animation
    from facecode.takes import Takes


def write_npz(animation: Animation, file: BinaryIO, progress: bool = False) -> None:  # noqa: ARG001
    """Write an animation to an open binary file; too quick for `progress`."""
    _write(file, animation, animation)


def write_takes_npz(takes: Takes, file: BinaryIO, progress: bool = False) -> None:  # noqa: ARG001
    """Write several faces of one recording: `vertices` (K, T, V, 3), `codes` (K, T, H)."""
    _write(file, takes, takes[0])


def _write(file: BinaryIO, moved: Animation | Takes, first: Animation) -> None:
    arrays = {"vertices": moved.vertices, "codes": moved.codes, "fps": np.float64(first.fps)}
    if len(first.parts) > 1:
        arrays["parts"] = np.array(list(first.parts))
        arrays["codes_per_part"] = np.array(list(first.parts.values()))
    np.savez(file, allow_pickle=False, **arrays)
