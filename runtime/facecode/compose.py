"""Codes of the parts to the motion of whole faces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facecode.arrays import Codes, Float32, Offsets
from facecode.part import Part


def compose(
    parts: Sequence[Part],
    n_vertices: int,
    clip: Sequence[Codes],
    hidden: Sequence[Float32 | None],
) -> tuple[Codes, Offsets]:
    """Rows of each part's codes (rows, T, H) to codes and offsets of all faces.

    What `window` has decoded already comes as hidden frames (rows, T, E).
    """
    n_faces = max(len(codes) for codes in clip)
    n_frames = clip[0].shape[1]
    offsets = np.empty((n_faces, n_frames, n_vertices, 3), dtype=np.float32)
    every = []
    for part, codes, shown in zip(parts, clip, hidden, strict=True):
        share = n_faces // len(codes)
        if shown is None:
            part.decode(codes, offsets[::share])
        else:
            part.show(shown, offsets[::share])
        for k in range(1, share):
            _copy(offsets[::share], offsets[k::share], part)
        every.append(np.repeat(codes, share, axis=0))
    return np.concatenate(every, axis=2), offsets


def _copy(source: Offsets, target: Offsets, part: Part) -> None:
    """The part's vertices of `source` into `target`, face by face."""
    if part.vertices is None:
        target[...] = source
    else:
        target[:, :, part.vertices] = source[:, :, part.vertices]
