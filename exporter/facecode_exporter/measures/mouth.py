"""How a mouth moves with its sounds: the same numbers for people and for models.

Comes in: curves of the gap between the lips and of the width of the mouth, the sounds, and the
loudness of the same clips. Goes out: numbers. Knows nothing of audio, bundles or files.

A gap is told in shares of the speaker's own range: 0 is the 5th percentile of all their frames, 1
the 95th. Frame k shows the moment (k + 0.5) / fps; a sound's frames are those whose moments lie
between its start and its end, and the nearest one where there is none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facecode_exporter.measures.phone import LIPS_TOGETHER, SILENCE, Phone

Curve = NDArray[np.float64]

ROUNDED = ("UW", "OW")
FRONT = ("IY", "IH", "EY", "EH")
OPEN = ("AA", "AE", "AH", "AW", "AY", "AO")
TONGUE = ("S", "Z", "T", "D", "N", "L")
TEETH = ("F", "V")
SHUT_BELOW, PARTED_ABOVE = 0.15, 0.15
SHORTEST_SILENCE_S, SETTLE_S = 0.3, 0.15
MOMENT_S = 0.08
"""Around a sound, in which its least gap is looked for."""
AROUND_S = 0.2
"""Either side of the start of a rounded sound, for what its gap is compared with."""
CURVE_S, CURVE_STEP_S = 0.4, 0.02
LONGEST_SHIFT = 4
"""Frames, either way, for the best shift."""


@dataclass(frozen=True, eq=False)
class Mouth:
    """One clip."""

    gap_mm: Curve
    """(T,)"""
    width_mm: Curve
    """(T,)"""
    loudness_db: Curve
    """(T,)"""
    phones: Sequence[Phone]
    fps: float

    def frames(self, start_s: float, end_s: float) -> slice:
        """Frames whose moments lie between two times; the nearest one where there is none."""
        n = len(self.gap_mm)
        first = int(np.ceil(start_s * self.fps - 0.5))
        last = int(np.floor(end_s * self.fps - 0.5))
        if last < first:
            first = last = round((start_s + end_s) / 2 * self.fps - 0.5)
        return slice(min(max(first, 0), n - 1), max(min(last + 1, n), 1))


@dataclass(frozen=True, eq=False)
class Speaker:
    """All clips of one speaker, and the range of their gap."""

    mouths: Sequence[Mouth]
    low_mm: float
    high_mm: float

    @classmethod
    def of(cls, mouths: Sequence[Mouth]) -> Speaker:
        """The range is taken over all frames of all clips."""
        low, high = np.percentile(np.concatenate([m.gap_mm for m in mouths]), [5, 95])
        return cls(mouths, float(low), float(high))

    def share(self, gap_mm: Curve) -> Curve:
        """A gap in shares of the range."""
        return np.asarray((gap_mm - self.low_mm) / max(self.high_mm - self.low_mm, 1e-9))

    def phones(self, names: Sequence[str] | frozenset[str]) -> Iterator[tuple[Mouth, Phone]]:
        """Sounds of some names in all clips."""
        return ((m, p) for m in self.mouths for p in m.phones if p.name in names)


def describe(speaker: Speaker) -> dict[str, float]:
    """What the table shows, by the names of its rows."""
    shut = [_least(speaker, m, p) for m, p in speaker.phones(LIPS_TOGETHER)]
    shares = [speaker.share(m.gap_mm) for m in speaker.mouths]
    fps = speaker.mouths[0].fps
    speed = [np.diff(s) * fps for s in shares]
    every = np.concatenate(speed)
    jerks = np.concatenate([np.abs(np.diff(s)) * fps for s in speed])
    dip, around = rounded_dip(speaker)
    silences = [_middle(speaker, m, p) for m, p in speaker.phones((SILENCE,)) if _is_long(p)]
    width = float(np.median(np.concatenate([m.width_mm for m in speaker.mouths])))
    return {
        "P B M below 0.10, %": 100 * _mean([value < 0.10 for value in shut]),
        "P B M below 0.15, %": 100 * _mean([value < SHUT_BELOW for value in shut]),
        "moment of least gap in P B M, ms": _median(list(_moments(speaker))),
        "lips behind loudness, ms": _median([lag for lag, _ in _lags(speaker)]),
        "r with loudness": _median([r for _, r in _lags(speaker)]),
        "speed p50, 1/s": float(np.percentile(np.abs(every), 50)),
        "speed p95, 1/s": float(np.percentile(np.abs(every), 95)),
        "closing speed p95, 1/s": float(np.percentile(-every[every < 0], 95)),
        "opening speed p95, 1/s": float(np.percentile(every[every > 0], 95)),
        "acceleration p99, 1/s2": float(np.percentile(jerks, 99)),
        "greatest gap in UW OW": _median(_greatest(speaker, ROUNDED)),
        "greatest gap in W": _median(_greatest(speaker, ("W",))),
        "greatest gap in IY IH EY EH": _median(_greatest(speaker, FRONT)),
        "greatest gap in AA AE AH AW AY AO": _median(_greatest(speaker, OPEN)),
        "greatest gap in S Z T D N L": _median(_greatest(speaker, TONGUE)),
        "least gap in F V": _median([_least(speaker, m, p) for m, p in speaker.phones(TEETH)]),
        "width in UW OW": _median(_widths(speaker, ROUNDED)) / width,
        "width in P B M": _median(_widths(speaker, LIPS_TOGETHER)) / width,
        "silences parted, %": 100 * _mean([value > PARTED_ABOVE for value in silences]),
        "gap at rest, mm": speaker.low_mm,
        "gap p95, mm": speaker.high_mm,
        "gap at the start of W UW OW, mm": dip,
        "gap 0.2 s around it, mm": around,
    }


def rounded_dip(speaker: Speaker) -> tuple[float, float]:
    """Mean gap in mm at the start of W UW OW, and over 0.2 s either side of it."""
    at, around = [], []
    for mouth, phone in speaker.phones(("W", *ROUNDED)):
        at.append(mouth.gap_mm[mouth.frames(phone.start_s, phone.start_s)].mean())
        start, stop = phone.start_s - AROUND_S, phone.start_s + AROUND_S
        around.append(mouth.gap_mm[mouth.frames(start, stop)].mean())
    return _mean(at), _mean(around)


def curve_around(speaker: Speaker, names: Sequence[str]) -> tuple[Curve, Curve]:
    """Times from the start of sounds of some names, and the mean gap there in shares."""
    times = np.arange(-CURVE_S, CURVE_S + CURVE_STEP_S / 2, CURVE_STEP_S)
    rows = [
        np.interp(phone.start_s + times, _times(mouth), speaker.share(mouth.gap_mm))
        for mouth, phone in speaker.phones(names)
    ]
    return times, np.mean(rows, axis=0) if rows else np.full(len(times), np.nan)


def agreement(curve: Curve, person: Curve) -> tuple[float, float]:
    """Pearson's r of a gap with a person's, as it is and at the best shift of whole frames."""
    each = []
    for shift in range(-LONGEST_SHIFT, LONGEST_SHIFT + 1):
        late, early = curve[max(shift, 0) :], person[max(-shift, 0) :]
        n = min(len(late), len(early))
        each.append(_pearson(late[:n], early[:n]))
    return each[LONGEST_SHIFT], float(np.nanmax(each)) if np.isfinite(each).any() else float("nan")


def confidence(values: Sequence[float], seed: int = 0) -> tuple[float, float]:
    """95 % of the medians of 2,000 samples of the clips, drawn with replacement."""
    defined = np.array([v for v in values if np.isfinite(v)])
    if not len(defined):
        return float("nan"), float("nan")
    drawn = np.random.default_rng(seed).choice(defined, (2000, len(defined)))
    low, high = np.percentile(np.median(drawn, axis=1), [2.5, 97.5])
    return float(low), float(high)


def _times(mouth: Mouth) -> Curve:
    return moments(len(mouth.gap_mm), mouth.fps)


def moments(n_frames: int, fps: float) -> Curve:
    """What each frame of a film shows, in seconds."""
    return np.asarray((np.arange(n_frames) + 0.5) / fps, np.float64)


def _least(speaker: Speaker, mouth: Mouth, phone: Phone) -> float:
    """Least gap in a sound or one frame beside it."""
    beside = 1 / mouth.fps
    return float(
        speaker.share(
            mouth.gap_mm[mouth.frames(phone.start_s - beside, phone.end_s + beside)]
        ).min()
    )


def _greatest(speaker: Speaker, names: Sequence[str]) -> list[float]:
    def greatest(mouth: Mouth, phone: Phone) -> float:
        return float(speaker.share(mouth.gap_mm[mouth.frames(phone.start_s, phone.end_s)]).max())

    return [greatest(mouth, phone) for mouth, phone in speaker.phones(names)]


def _widths(speaker: Speaker, names: Sequence[str] | frozenset[str]) -> list[float]:
    return [
        float(np.median(m.width_mm[m.frames(p.start_s, p.end_s)])) for m, p in speaker.phones(names)
    ]


def _moments(speaker: Speaker) -> Iterator[float]:
    """When P B M shut, after the start of the sound, in ms."""
    for mouth, phone in speaker.phones(LIPS_TOGETHER):
        part = mouth.frames(phone.start_s - MOMENT_S, phone.end_s + MOMENT_S)
        least = part.start + int(np.argmin(mouth.gap_mm[part]))
        yield 1000 * ((least + 0.5) / mouth.fps - phone.start_s)


def _is_long(phone: Phone) -> bool:
    return phone.end_s - phone.start_s >= SHORTEST_SILENCE_S


def _middle(speaker: Speaker, mouth: Mouth, phone: Phone) -> float:
    part = mouth.frames(phone.start_s + SETTLE_S, phone.end_s - SETTLE_S)
    return float(np.median(speaker.share(mouth.gap_mm[part])))


def _lags(speaker: Speaker) -> list[tuple[float, float]]:
    """For each clip how late the lips are behind the loudness, in ms, and Pearson's r there."""
    found = []
    for mouth in speaker.mouths:
        times, n = _times(mouth), round(0.2 / 0.01)
        rows = []
        for shift in np.arange(-n, n + 1) * 0.01:
            gap = np.interp(times + shift, times, mouth.gap_mm)
            rows.append((1000 * float(shift), _pearson(gap[5:-5], mouth.loudness_db[5:-5])))
        found.append(max(rows, key=lambda row: row[1] if np.isfinite(row[1]) else -2.0))
    return found


def _pearson(a: Curve, b: Curve) -> float:
    if len(a) < 3 or not np.ptp(a) or not np.ptp(b):
        return float("nan")
    return float(np.corrcoef(a, b)[0, 1])


def _of(values: Sequence[float] | Sequence[bool], how: Callable[..., float]) -> float:
    return float(how(values)) if len(values) else float("nan")


def _mean(values: Sequence[float] | Sequence[bool]) -> float:
    return _of(values, np.mean)


def _median(values: Sequence[float]) -> float:
    return _of(values, np.median)
