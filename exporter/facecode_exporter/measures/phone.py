"""Sounds of speech in time, and the kinds that measures judge by."""

from __future__ import annotations

from typing import NamedTuple

SILENCE = "SIL"
LIPS_TOGETHER = frozenset("PBM")
OPEN_VOWELS = frozenset(("AA", "AE", "AO", "AW", "AY"))


class Phone(NamedTuple):
    """An ARPABET sound without stress, or SIL."""

    name: str
    start_s: float
    end_s: float
