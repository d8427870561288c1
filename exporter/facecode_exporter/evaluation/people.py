"""People and a model on the same sound: how each moves the mouth, and how alike the two are.

Comes in: tracks of people, and an animator with a lip pair. Goes out: numbers and curves. The
arithmetic is in `measures.mouth`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from facecode.animator import Animator
from facecode.audio import load_audio
from facecode.clip import Clip
from facecode.options import Mode
from facecode_exporter.data.tracks import Curve, Track
from facecode_exporter.errors import EvaluationError
from facecode_exporter.evaluation.distances import Progress
from facecode_exporter.measures.mouth import (
    Mouth,
    Speaker,
    agreement,
    confidence,
    describe,
    moments,
)
from facecode_exporter.measures.regions import LIPS

RATE = 16_000
LOUDNESS_S = 0.04
QUIETEST = 1e-5


@dataclass(frozen=True, eq=False)
class Judged:
    """People, and the model on their sound, clip by clip in the same order."""

    names: Sequence[str]
    people: Speaker
    model: Speaker

    def agreements(self) -> list[tuple[float, float]]:
        """Of each clip Pearson's r of the gaps, as they are and at the best shift."""
        pairs = zip(self.model.mouths, self.people.mouths, strict=True)
        return [agreement(m.gap_mm, p.gap_mm) for m, p in pairs]

    def plain(self) -> dict[str, object]:
        """All numbers, for JSON."""
        each = self.agreements()
        still, shifted = ([pair[i] for pair in each] for i in (0, 1))
        return {
            "clips": len(self.names),
            "people": _known(describe(self.people)),
            "model": _known(describe(self.model)),
            "r": {
                "median": float(np.nanmedian(still)),
                "confidence": confidence(still),
                "best_shift_median": float(np.nanmedian(shifted)),
                "best_shift_confidence": confidence(shifted),
            },
            "r_by_clip": _known(dict(zip(self.names, still, strict=True))),
        }


def _known(numbers: Mapping[str, float]) -> dict[str, float | None]:
    """Numbers that JSON can hold; None where there was nothing to judge."""
    return {name: value if np.isfinite(value) else None for name, value in numbers.items()}


def judge_people(
    animator: Animator,
    tracks: Sequence[Track],
    style: str | None,
    progress: Progress[Track],
    *,
    mode: Mode = "exact",
) -> Judged:
    """Animate every clip, and put the model's mouth beside the person's.

    The clips of a split share one range of the gap, also those of several speakers.

    Raises:
        EvaluationError: the bundle does not know its lip pair or its unit.
    """
    m = animator.manifest
    if animator.bundle.lip_pair is None or m.metres_per_unit is None:
        raise EvaluationError(
            "people are compared in mm between the lips: export the bundle with --lip-pair U,L, "
            "and with its unit"
        )
    people, model = [], []
    for track in progress(tracks):
        sound = load_audio(track.sound, RATE)
        clip = animator.animate(sound, style, sample_rate=RATE, mode=mode)
        times = moments(len(track.gap_mm), track.fps)
        loudness = _loudness(np.asarray(sound, np.float64), times)
        gap, width = _model_curves(clip, animator, times)
        people.append(Mouth(track.gap_mm, track.width_mm, loudness, track.phones, track.fps))
        model.append(Mouth(gap, width, loudness, track.phones, track.fps))
    return Judged([t.name for t in tracks], Speaker.of(people), Speaker.of(model))


def _model_curves(clip: Clip, animator: Animator, times: Curve) -> tuple[Curve, Curve]:
    """Gap, 0 in the neutral face, and width of the lips in mm, at the moments of a film."""
    assert animator.bundle.lip_pair is not None, "checked before"
    upper, lower = animator.bundle.lip_pair
    mm = 1000 * (animator.manifest.metres_per_unit or 1)
    vertices, shown = clip.vertices, np.arange(clip.n_frames) / clip.fps
    gap = np.linalg.norm(vertices[:, upper] - vertices[:, lower], axis=1)
    gap = gap - np.linalg.norm(clip.template[upper] - clip.template[lower])
    width = np.full(clip.n_frames, np.nan)
    if LIPS in animator.manifest.regions:
        width = np.ptp(vertices[:, animator.bundle.region(LIPS), 0], axis=1)
    return np.interp(times, shown, mm * gap), np.interp(times, shown, mm * width)


def _loudness(sound: Curve, times: Curve) -> Curve:
    """Level in dB around each moment."""
    half = round(LOUDNESS_S / 2 * RATE)
    centres = (times * RATE).astype(int)
    powers = [np.square(sound[max(0, c - half) : c + half]).mean() for c in centres]
    return np.asarray(10 * np.log10(np.maximum(np.nan_to_num(powers), QUIETEST**2)))
