"""Codes that a caller gives."""

from __future__ import annotations

import numpy as np

from facecode.arrays import AnyArray, Codes
from facecode.errors import CodesError
from facecode.loop.part import Part


def check_codes(codes: AnyArray, part: Part, n_frames: int | None = None) -> Codes:
    """Codes (..., T, H) of a part as int64.

    Raises:
        CodesError: not whole numbers, another H, outside the codebook, or not `n_frames` long.
        NoCodesError: a part without a codebook.
    """
    codebook, _ = part.prior
    array = np.asarray(codes)
    n_codes, wide = len(codebook.rows), part.codes_per_frame
    if array.ndim < 2 or array.shape[-1] != wide or array.dtype.kind not in "iu":
        raise CodesError(
            f"got {array.dtype} codes {array.shape} for {part.name}; expected whole numbers "
            f"(T, {wide})"
        )
    if array.size and not (array.min() >= 0 and array.max() < n_codes):
        raise CodesError(
            f"got codes {array.min()} to {array.max()} for {part.name}; expected 0 to {n_codes - 1}"
        )
    if n_frames is not None and array.shape[-2] != n_frames:
        raise CodesError(
            f"got codes of {array.shape[-2]} frames to hold for {part.name}; this speech has "
            f"{n_frames}"
        )
    return array.astype(np.int64)
