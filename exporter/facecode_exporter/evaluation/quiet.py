"""How still a stream is where nobody speaks: zeros and the noise of rooms, between speech.

Comes in: an animator. Goes out: for each kind and level of quiet the share of frames in which the
mouth is open, and blinks. The noises are made here, not those that models are trained in.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from facecode.animator import Animator
from facecode.arrays import AnyArray, Audio, Float32
from facecode.audio import SPEECH, load_audio
from facecode.live.drive import frames_of
from facecode.live.stream import Stream
from facecode_exporter.errors import EvaluationError
from facecode_exporter.evaluation.distances import Progress
from facecode_exporter.evaluation.report import table
from facecode_exporter.measures.lip_sync import CLOSED_BELOW, FULL_PERCENTILE, opening_curve

LEVELS_DB = (-60.0, -50.0, -30.0)
SPEECH_S, SETTLE_S = 3.0, 1.0
"""Speech before the quiet, and the beginning of the quiet that is not judged."""
SHUT = 0.5
"""Of a blink at its deepest; less is a squint."""
LIDS = "eyeBlinkLeft"
Sound = AnyArray


@dataclass(frozen=True)
class Quiet:
    """One kind of quiet at one level."""

    kind: str
    level_db: float | None
    """Root mean square, dBFS; None: zeros."""
    open_share: float
    """Frames in which the mouth is open by more than 15 % of what it is in speech."""
    blinks_a_minute: float | None
    """None: a bundle without eyelids."""


def _coloured(power: float) -> Callable[[int, int, np.random.Generator], Sound]:
    def noise(n: int, rate: int, rng: np.random.Generator) -> Sound:
        spectrum = np.fft.rfft(rng.standard_normal(n))
        frequency = np.maximum(np.fft.rfftfreq(n, 1 / rate), 20.0)
        return np.fft.irfft(spectrum * frequency ** (-power / 2), n)

    return noise


def _hum(n: int, rate: int, rng: np.random.Generator) -> Sound:
    times = np.arange(n) / rate
    waves = [np.sin(2 * np.pi * 50 * k * times + rng.uniform(0, 6)) / k for k in (1, 2, 3, 5, 7)]
    return np.asarray(sum(waves) + 0.02 * rng.standard_normal(n))


def _fan(n: int, rate: int, rng: np.random.Generator) -> Sound:
    times = np.arange(n) / rate
    blades = 1 + 0.3 * np.sin(2 * np.pi * 7 * times) + 0.2 * np.sin(2 * np.pi * 23 * times)
    return np.asarray(_coloured(1.0)(n, rate, rng) * blades)


NOISES: Mapping[str, Callable[[int, int, np.random.Generator], Sound]] = {
    "white": _coloured(0.0),
    "pink": _coloured(1.0),
    "brown": _coloured(2.0),
    "hum": _hum,
    "fan": _fan,
}


def noise(kind: str, level_db: float, n: int, rate: int, seed: int = 0) -> Audio:
    """(n,) of a kind of NOISES, with a root mean square of `level_db` dBFS."""
    sound = NOISES[kind](n, rate, np.random.default_rng(seed))
    return np.asarray(sound * 10 ** (level_db / 20) / np.sqrt(np.square(sound).mean()), np.float32)


def judge_quiet(
    animator: Animator,
    style: str,
    lip_pair: tuple[int, int],
    seconds: float,
    rest_in_quiet: bool,
    progress: Progress[tuple[str, float | None]],
) -> Iterator[Quiet]:
    """Stream three seconds of the packaged recording and then `seconds` of each quiet.

    Args:
        animator: a bundle with a template.
        style: a name that the bundle knows.
        lip_pair: of `require_lip_pair`.
        seconds: of each quiet, more than a second.
        rest_in_quiet: of `Animator.stream`.
        progress: wraps the list of work.

    Raises:
        EvaluationError: too few seconds.
    """
    if not seconds > SETTLE_S:
        raise EvaluationError(f"got {seconds} s of quiet; expected more than {SETTLE_S:g}")
    rate, fps = animator.manifest.sample_rate, animator.manifest.fps
    speech = load_audio(SPEECH, rate)[: round(SPEECH_S * rate)]
    n, first = round(seconds * rate), math.ceil((SPEECH_S + SETTLE_S) * fps)
    work: list[tuple[str, float | None]] = [("zeros", None)]
    work += [(kind, level) for kind in NOISES for level in LEVELS_DB]
    for kind, level in progress(work):
        quiet = np.zeros(n, np.float32) if level is None else noise(kind, level, n, rate)
        stream = animator.stream(style, vertices=True, rest_in_quiet=rest_in_quiet)
        opening, lids = _curves(animator, stream, np.concatenate([speech, quiet]), lip_pair)
        full = np.percentile(opening[: round(SPEECH_S * fps)], FULL_PERCENTILE)
        yield Quiet(
            kind,
            level,
            open_share=float((opening[first:] > CLOSED_BELOW * full).mean()),
            blinks_a_minute=_blinks(lids[first:], fps) if len(lids) else None,
        )


def _curves(
    animator: Animator, stream: Stream, sound: Audio, lip_pair: tuple[int, int]
) -> tuple[Float32, Float32]:
    """Opening (T,) and the lid's weight (T,), or none, a second at a time."""
    pair, rate, names = list(lip_pair), stream.plan.rate, stream.weight_names
    gaps: list[Float32] = []
    lids: list[float] = []
    seconds = [sound[start : start + rate] for start in range(0, len(sound), rate)]
    for frame in frames_of(stream, seconds):
        assert frame.offsets is not None, "asked for"
        gaps.append(frame.offsets[pair])
        if frame.weights is not None and LIDS in names:
            lids.append(float(frame.weights[names.index(LIDS)]))
    neutral = animator.bundle.template[pair]
    opening = opening_curve(np.stack(gaps) + neutral, (0, 1), neutral)
    return opening, np.array(lids, np.float32)


def _blinks(lids: Float32, fps: float) -> float:
    shut = lids > SHUT
    return float(60 * fps * np.count_nonzero(shut[1:] & ~shut[:-1]) / len(shut))


def quiet_table(found: list[Quiet]) -> str:
    """A row for each kind and level."""
    rows: list[tuple[str, ...]] = [("quiet", "level", "mouth open", "blinks a minute")]
    for each in found:
        level = "" if each.level_db is None else f"{each.level_db:g} dBFS"
        blinks = "-" if each.blinks_a_minute is None else f"{each.blinks_a_minute:.1f}"
        rows.append((each.kind, level, f"{100 * each.open_share:.1f} %", blinks))
    return table(rows)
