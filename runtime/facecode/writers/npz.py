"""numpy's .npz: `vertices` (T, V, 3) float32, `codes` (T, H) int64, `fps` ()."""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

import numpy as np

if TYPE_CHECKING:
    from facecode.animation import Animation


def write_npz(animation: Animation, file: BinaryIO, progress: bool = False) -> None:  # noqa: ARG001
    """Write an animation to an open binary file; too quick for `progress`."""
    np.savez(
        file,
        vertices=animation.vertices,
        codes=animation.codes,
        fps=np.float64(animation.fps),
    )
