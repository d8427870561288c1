"""How far a stream is from the whole recording: the same speech in mode `live` and in `exact`.

Comes in: an animator and recordings whose sounds are placed. Goes out: what the manifest states as
`live`, and a table for people. Pooled: r and acceleration are of the frames of all recordings.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facecode.animation import Animation
from facecode.animator import Animator
from facecode.arrays import Float32
from facecode.bundle import Bundle
from facecode.live.plan import live_entry
from facecode_exporter.data.recordings import Recording
from facecode_exporter.errors import EvaluationError
from facecode_exporter.evaluation.distances import Progress
from facecode_exporter.evaluation.report import table
from facecode_exporter.measures import lip_sync
from facecode_exporter.measures.lip_sync import Share
from facecode_exporter.measures.signals import POP_PERCENTILE, accelerations, pearson
from facecode_spec.live import Count, LipCounts, LiveDeviation, LiveMeasure
from facecode_spec.plain import SpecError

LOOK_AHEADS_MS = (100.0, 200.0, 400.0)
NOTHING = Share()


@dataclass
class _Motion:
    """What is kept of one way of animating."""

    openings: list[Float32] = dataclasses.field(default_factory=list)
    accelerations: list[Float32] = dataclasses.field(default_factory=list)
    closed: Share = NOTHING
    opened: Share = NOTHING
    rested: Share = NOTHING

    def add(self, clip: Animation, recording: Recording, lip_pair: tuple[int, int]) -> None:
        """Take in one recording."""
        vertices = clip.vertices
        opening = lip_sync.opening_curve(vertices, lip_pair, clip.template)
        self.openings.append(opening)
        self.accelerations.append(accelerations(vertices, clip.fps).astype(np.float32))
        on = (recording.phones, lip_sync.relative_opening(opening), clip.fps)
        self.closed += Share.of(lip_sync.closures(*on))
        self.opened += Share.of(lip_sync.openings(*on))
        self.rested += Share.of(lip_sync.rests(*on))

    @property
    def lips(self) -> LipCounts:
        """The sounds that the lips met."""
        kinds = (self.closed, self.opened, self.rested)
        return LipCounts(*(Count(kind.n, kind.met) for kind in kinds))

    @property
    def acceleration(self) -> float:
        """Of the frames of all recordings, the 99th percentile."""
        return float(np.percentile(np.concatenate(self.accelerations), POP_PERCENTILE))

    def deviation(self, exact: _Motion, look_ahead_ms: float) -> LiveDeviation:
        """From `exact`, which has the same frames."""
        r = pearson(np.concatenate(self.openings), np.concatenate(exact.openings))
        ratio = self.acceleration / exact.acceleration if exact.acceleration else None
        return LiveDeviation(look_ahead_ms, r if np.isfinite(r) else None, ratio, self.lips)


def measure_live(
    animator: Animator,
    recordings: Sequence[Recording],
    style: str,
    lip_pair: tuple[int, int],
    progress: Progress[Recording],
) -> LiveMeasure:
    """Stream every recording with each of LOOK_AHEADS_MS, and animate it as a whole.

    Args:
        animator: a bundle with a template.
        recordings: of `read_recordings`.
        style: a name that the bundle knows.
        lip_pair: of `require_lip_pair`.
        progress: wraps the list of work.

    Raises:
        AudioTooShortError: a recording of less than a frame.
    """
    exact, live = _Motion(), {ms: _Motion() for ms in LOOK_AHEADS_MS}
    for recording in progress(recordings):
        whole = animator.animate(recording.path, style, mode="exact")
        exact.add(whole, recording, lip_pair)
        for ms, motion in live.items():
            clip = animator.animate(recording.path, style, mode="live", look_ahead_ms=ms)
            motion.add(clip, recording, lip_pair)
    return LiveMeasure(
        n_recordings=len(recordings),
        seconds=round(sum(recording.duration_s for recording in recordings), 3),
        style=style,
        exact=exact.lips,
        look_aheads=tuple(motion.deviation(exact, ms) for ms, motion in live.items()),
    )


def live_table(measured: LiveMeasure) -> str:
    """A row for each look-ahead, and one for the whole recordings."""
    rows: list[tuple[str, ...]] = [
        ("look-ahead", "r of opening", "P B M close", "vowels open", "silences rest", "acc")
    ]
    for each in measured.look_aheads:
        r, ratio = each.opening_r, each.acceleration_ratio
        known = ("-" if r is None else f"{r:.3f}", "-" if ratio is None else f"{ratio:.2f} x")
        rows.append((f"{each.look_ahead_ms:g} ms", known[0], *_lips(each.lips), known[1]))
    rows.append(("whole recording", "1", *_lips(measured.exact), "1 x"))
    return table(rows)


def _lips(lips: LipCounts) -> tuple[str, ...]:
    kinds = (lips.closures, lips.openings, lips.rests)
    return tuple(f"{kind.met} of {kind.n}" for kind in kinds)


def with_plan(bundle: Bundle, context_s: float | None, block_s: float | None) -> Bundle:
    """The bundle streamed with another context or block; None: its own.

    Raises:
        EvaluationError: a length that no stream has.
    """
    entry = live_entry(bundle.manifest)
    try:
        changed = dataclasses.replace(
            entry,
            context_s=entry.context_s if context_s is None else context_s,
            block_s=entry.block_s if block_s is None else block_s,
            measured=None,
        )
    except SpecError as error:
        raise EvaluationError(str(error)) from error
    manifest = dataclasses.replace(bundle.manifest, live=changed)
    return dataclasses.replace(bundle, manifest=manifest)
