"""Lip sync of a head whose size is known, in metres: closures, openings and rests, counted.

Comes in: phones and the mouth opening per frame, from labels or from a model. Goes out: counts.
Knows nothing of weights, heads or audio.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np

from facecode.arrays import Float32
from facecode_exporter.measures.phone import LIPS_TOGETHER, OPEN_VOWELS, SILENCE, Phone

CLOSED_M = 0.5e-3  # at most this much wider than at rest
OPEN_M = 1.5e-3  # at least this much wider than at rest; mumbled vowels open by 2.8 mm or more
RESTING_M = 1.0e-3
AROUND_S = 0.05  # motion leads sound, and phone times are 12 ms off on average
SHORTEST_REST_S = 0.3
FADE_S = 0.12  # of a silence, at either end, in which the mouth may still move


@dataclass(frozen=True)
class LipSync:
    """How many of the P B M closed, the open vowels opened, and the silences rested."""

    n_closures: int = 0
    closed: int = 0
    n_openings: int = 0
    opened: int = 0
    n_rests: int = 0
    rested: int = 0

    def __add__(self, other: LipSync) -> LipSync:
        names = [field.name for field in fields(self)]
        return LipSync(**{n: getattr(self, n) + getattr(other, n) for n in names})

    def __str__(self) -> str:
        pairs = (
            ("P B M closed", self.closed, self.n_closures),
            ("open vowels open", self.opened, self.n_openings),
            ("at rest in silence", self.rested, self.n_rests),
        )
        return ", ".join(f"{what} {_percent(k, n)} of {n}" for what, k, n in pairs)


def count_lip_sync(phones: Iterable[Phone], opening: Float32, rest: float, fps: float) -> LipSync:
    """Count over one clip.

    Args:
        phones: of the clip, from 0 to its end.
        opening: (T,) metres between the lips, frame t at t / fps seconds.
        rest: metres between the lips of the neutral face.
        fps: frames per second of `opening`.
    """
    wider = opening - rest

    def during(start_s: float, end_s: float) -> Float32:
        return wider[max(0, int(np.ceil(start_s * fps))) : int(end_s * fps) + 1]

    total = LipSync()
    for name, start_s, end_s in phones:
        around = during(start_s - AROUND_S, end_s + AROUND_S)
        if name in LIPS_TOGETHER and len(around):
            total += LipSync(n_closures=1, closed=int(around.min() <= CLOSED_M))
        elif name in OPEN_VOWELS and len(around):
            total += LipSync(n_openings=1, opened=int(around.max() >= OPEN_M))
        elif name == SILENCE and end_s - start_s >= SHORTEST_REST_S:
            inside = during(start_s + FADE_S, end_s - FADE_S)
            if len(inside):
                total += LipSync(n_rests=1, rested=int(np.median(inside) <= RESTING_M))
    return total


def _percent(part: int, whole: int) -> str:
    return f"{100 * part / whole:.1f} %" if whole else "-"
