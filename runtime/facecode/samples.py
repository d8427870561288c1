"""How many samples of each part a caller asks for, and which codes he holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from facecode.arrays import AnyArray, Codes
from facecode.errors import CodesError, SampleError
from facecode.loop import Counts
from facecode.part import Part

Samples: TypeAlias = int | Counts
"""A number, for the first part that has several; or numbers by part name."""


def sample_counts(samples: Samples | None, parts: Sequence[Part]) -> dict[str, int]:
    """Samples to generate of each part, in the order of `parts`; 1 where none are asked for.

    Raises:
        SampleError: an unknown part, fewer than one, or more than the part has heads.
    """
    several = {p.name: p.n_samples for p in parts if p.n_samples > 1}
    if samples is None:
        asked: Counts = {}
    elif isinstance(samples, Mapping):
        asked = samples
    else:
        asked = {next(iter(several), parts[0].name): samples}
    heads = {p.name: p.n_samples for p in parts}
    for name, n in asked.items():
        if name not in heads:
            raise SampleError(f"got samples of {name!r}; the parts are {', '.join(heads)}")
        if not 1 <= n <= heads[name]:
            can = ", ".join(f"{part} {k}" for part, k in several.items()) or "one face a voice"
            raise SampleError(
                f"got {n} samples of {name}; expected 1 to {heads[name]} (this bundle gives: {can})"
            )
    return {name: asked.get(name, 1) for name in heads}


def head_numbers(counts: Counts) -> dict[str, AnyArray]:
    """For each part the head that answers for each row of a clip: (product so far,) int64."""
    numbers, rows = {}, 1
    for name, n in counts.items():
        numbers[name] = np.tile(np.arange(n), rows)
        rows *= n
    return numbers


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
