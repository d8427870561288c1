"""Lip sync without captured motion: do lips close, open and rest as the sounds demand?

Comes in: the mouth opening per frame and the phones of the same recording. Goes out: verdicts and
shares. Knows nothing of audio, bundles or files.

One grid for all: frame t is shown at t / fps seconds, and a phone owns the frames from its start to
its end, both included. Frames before the first and after the last do not exist: a phone that keeps
no frame inside the clip is not judged and counts nowhere. `closures`, `openings` and `rests` judge
any face, in shares of the clip's own full opening, so that small articulation is not penalised;
`count_lip_sync` counts the three on a head whose size is known, in metres.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from typing import TypeAlias

import numpy as np

from facecode.arrays import AnyArray, Float32, Offsets, Template
from facecode_exporter.measures.phone import LIPS_TOGETHER, OPEN_VOWELS, SILENCE, Phone

CLOSED_BELOW, OPEN_ABOVE = 0.15, 0.35  # of the full opening
FULL_PERCENTILE = 95.0
SHORTEST_CLOSURE_S, SHORTEST_OPENING_S, SHORTEST_SILENCE_S = 0.04, 0.06, 0.3
SETTLE_S = 0.15  # at either end of a silence, in which the mouth may still move
CHANCE_STEP = 5
CLOSED_M = 0.5e-3  # at most this much wider than at rest
OPEN_M = 1.5e-3  # at least this much wider than at rest; mumbled vowels open by 2.8 mm or more
RESTING_M = 1.0e-3
AROUND_S = 0.05  # motion leads sound, and phone times are 12 ms off on average
FADE_S = 0.12  # of a silence of known size, at either end, in which the mouth may still move
_GRID_S = 1e-6  # times are decimal, frames binary: 0.1 s at 30 fps is frame 3


@dataclass(frozen=True)
class Verdict:
    """One phone: the opening that decided, and whether it is what the sound demands."""

    phone: Phone
    opening: float
    met: bool


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


Judge: TypeAlias = "Callable[[Iterable[Phone], Float32, float], list[Verdict]]"
"""`closures`, `openings` or `rests`."""


@dataclass(frozen=True)
class Share:
    """How many of `n` phones met the demand."""

    n: int = 0
    met: int = 0

    @classmethod
    def of(cls, verdicts: Iterable[Verdict]) -> Share:
        """Count verdicts."""
        each = [v.met for v in verdicts]
        return cls(len(each), sum(each))

    def __add__(self, other: Share) -> Share:
        return Share(self.n + other.n, self.met + other.met)

    @property
    def share(self) -> float | None:
        """`met` / `n`, None where there was nothing to judge."""
        return self.met / self.n if self.n else None


def opening_curve(vertices: Offsets, lip_pair: Sequence[int], template: Template) -> Float32:
    """Mouth opening (T,): distance of the lip pair minus its distance in the template. Unit: mesh.

    Negative where lips press beyond rest. The distance, not its vertical part: it needs no up axis,
    and on label motion both find every closure (29 of 29 phones, in each of eight styles).
    """
    upper, lower = lip_pair
    gap = np.linalg.norm(vertices[:, upper] - vertices[:, lower], axis=1)
    rest = np.linalg.norm(template[upper] - template[lower])
    return np.asarray(gap - rest, dtype=np.float32)


def relative_opening(opening: AnyArray, frozen: float = 0.0) -> Float32:
    """`opening` (T,) in units of the clip's full opening, its 95th percentile over all frames.

    The percentile interpolates linearly. A mouth whose full opening is `frozen` or less does not
    move: its curve is 0 throughout, so that it closes and rests always and opens never.
    """
    full = float(np.percentile(opening, FULL_PERCENTILE)) if len(opening) else 0.0
    if full <= max(frozen, 0.0):
        return np.zeros(len(opening), dtype=np.float32)
    return np.asarray(opening / full, dtype=np.float32)


def closures(phones: Iterable[Phone], relative: Float32, fps: float) -> list[Verdict]:
    """P, B and M of 40 ms or more: met if the opening falls below 15 % within one frame.

    Within one frame: in a frame that the phone owns, the one before them or the one after.
    """
    return _judged(
        (p for p in phones if p.name in LIPS_TOGETHER and _lasts(p, SHORTEST_CLOSURE_S)),
        lambda p: relative[frames(p.start_s, p.end_s, fps, len(relative), around=1)],
        lambda part: float(part.min()),
        lambda opening: opening < CLOSED_BELOW,
    )


def openings(phones: Iterable[Phone], relative: Float32, fps: float) -> list[Verdict]:
    """AA, AE, AO, AW and AY of 60 ms or more: met if the opening exceeds 35 % in an owned frame."""
    return _judged(
        (p for p in phones if p.name in OPEN_VOWELS and _lasts(p, SHORTEST_OPENING_S)),
        lambda p: relative[frames(p.start_s, p.end_s, fps, len(relative))],
        lambda part: float(part.max()),
        lambda opening: opening > OPEN_ABOVE,
    )


def rests(phones: Iterable[Phone], relative: Float32, fps: float) -> list[Verdict]:
    """Silences of 300 ms or more: met if the mouth comes to rest (below 15 %) and stays there.

    Every frame from 150 ms after the start to 150 ms before the end must be below; the end is
    spared because mouths open before they sound. Where no frame falls in between, the first one
    after those 150 ms decides. The same holds at the ends of the clip.
    """

    def settled(phone: Phone) -> Float32:
        start_s = phone.start_s + SETTLE_S
        part = frames(start_s, phone.end_s - SETTLE_S, fps, len(relative))
        first = _first_frame(start_s, fps)
        return relative[part] if part.start < part.stop else relative[first : first + 1]

    return _judged(
        (p for p in phones if p.name == SILENCE and _lasts(p, SHORTEST_SILENCE_S)),
        settled,
        lambda part: float(part.max()),
        lambda opening: opening < CLOSED_BELOW,
    )


def chance(judge: Judge, phones: Sequence[Phone], relative: Float32, fps: float) -> float | None:
    """Share that `judge` would give motion of the same kind that knows nothing of these phones.

    The mean share over the curve shifted in a circle by a quarter to three quarters of the clip, in
    steps of 5 frames from n // 4 on. A mouth that moves much closes somewhere near most phones: on
    label motion of 25 s of speech 100 % of P B M close, and by chance 53 %. None where there is
    nothing to judge.
    """
    n = len(relative)
    shifts = range(n // 4, n - n // 4 + 1, CHANCE_STEP)
    shares = [Share.of(judge(phones, np.roll(relative, k), fps)).share for k in shifts]
    defined = [s for s in shares if s is not None]
    return float(np.mean(defined)) if defined else None


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
        return wider[frames(start_s, end_s, fps, len(wider))]

    total = LipSync()
    for name, start_s, end_s in phones:
        around = during(start_s - AROUND_S, end_s + AROUND_S)
        if name in LIPS_TOGETHER and len(around):
            total += LipSync(n_closures=1, closed=int(around.min() <= CLOSED_M))
        elif name in OPEN_VOWELS and len(around):
            total += LipSync(n_openings=1, opened=int(around.max() >= OPEN_M))
        elif name == SILENCE and end_s - start_s >= SHORTEST_SILENCE_S:
            inside = during(start_s + FADE_S, end_s - FADE_S)
            if len(inside):
                total += LipSync(n_rests=1, rested=int(np.median(inside) <= RESTING_M))
    return total


def frames(start_s: float, end_s: float, fps: float, n_frames: int, around: int = 0) -> slice:
    """Frames t with start_s <= t / fps <= end_s, and `around` more at either end, in the clip."""
    first = _first_frame(start_s, fps) - around
    last = math.floor((end_s + _GRID_S) * fps) + around
    return slice(min(max(first, 0), n_frames), max(min(last + 1, n_frames), 0))


def _first_frame(start_s: float, fps: float) -> int:
    return math.ceil((start_s - _GRID_S) * fps)


def _lasts(phone: Phone, shortest_s: float) -> bool:
    return phone.end_s - phone.start_s >= shortest_s - _GRID_S


def _judged(
    phones: Iterable[Phone],
    part_of: Callable[[Phone], Float32],
    deciding: Callable[[Float32], float],
    meets: Callable[[float], bool],
) -> list[Verdict]:
    def judge() -> Iterator[Verdict]:
        for phone in phones:
            part = part_of(phone)
            if len(part):
                opening = deciding(part)
                yield Verdict(phone, opening, meets(opening))

    return list(judge())


def _percent(part: int, whole: int) -> str:
    return f"{100 * part / whole:.1f} %" if whole else "-"
