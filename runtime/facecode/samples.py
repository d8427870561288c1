"""How many samples of each part a caller asks for, and which codes he holds."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TypeAlias

import numpy as np

from facecode.arrays import AnyArray, Codes
from facecode.errors import CodesError, SampleError
from facecode.part import Part

Samples: TypeAlias = "int | Mapping[str, int]"
"""How many faces, or how many samples by part name."""


def sample_heads(
    samples: Samples | None, parts: Sequence[Part], held: Collection[str] = ()
) -> dict[str, AnyArray]:
    """For each part that is not held the head that answers for each row of a clip, (rows,) int64.

    K faces are K samples of the first part that gives several, each continued by the sample of the
    same number of every later part. Numbers by part combine each sample of a part with each of
    the part before. None is the first sample of every part.

    Raises:
        SampleError: a part that is unknown or held, fewer than one, or more than it has heads.
    """
    free = [part for part in parts if part.name not in held]
    if isinstance(samples, Mapping):
        return _combined(samples, free)
    heads = {part.name: np.zeros(1, np.int64) for part in free}
    if samples is None:
        return heads
    names = [part.name for part in free]
    first = next((i for i, part in enumerate(free) if part.n_samples > 1), 0)
    _check_count(samples, free, names[first] if names else "")
    for part in free[first:]:
        heads[part.name] = np.arange(samples) % part.n_samples
    return heads


def _combined(counts: Mapping[str, int], free: Sequence[Part]) -> dict[str, AnyArray]:
    heads, rows = {}, 1
    for name, n in counts.items():
        _check_count(n, free, name)
    for part in free:
        n = counts.get(part.name, 1)
        heads[part.name] = np.tile(np.arange(n), rows)
        rows *= n
    return heads


def _check_count(n: int, free: Sequence[Part], name: str) -> None:
    can = {part.name: part.n_samples for part in free}
    if name not in can:
        raise SampleError(
            f"got samples of {name or 'nothing'}; the parts that can vary are "
            f"{', '.join(can) or 'none'}"
        )
    if not 1 <= n <= can[name]:
        gives = ", ".join(f"{part} {k}" for part, k in can.items())
        raise SampleError(
            f"got {n} samples of {name}; expected 1 to {can[name]} (this bundle gives: {gives})"
        )


def check_codes(codes: AnyArray, part: Part, n_frames: int | None = None) -> Codes:
    """Codes (..., T, H) of a part as int64.

    Raises:
        CodesError: not whole numbers, another H, outside the codebook, or not `n_frames` long.
    """
    array = np.asarray(codes)
    n_codes, wide = len(part.codebook.rows), part.codes_per_frame
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
