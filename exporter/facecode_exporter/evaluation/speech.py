"""Animate recordings whose sounds are placed, and judge the lips.

Comes in: recordings, an animator, perhaps a reference. Goes out: what was measured, one recording
and style after the other. The arithmetic is in `lip_sync` and `signals`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from facecode.animation import Animation
from facecode.animator import Animator
from facecode.arrays import Float32, Indices
from facecode.options import Mode
from facecode_exporter.data.recordings import Recording
from facecode_exporter.errors import EvaluationError
from facecode_exporter.evaluation.distances import Progress
from facecode_exporter.evaluation.reference import Reference, ReferenceSource
from facecode_exporter.measures import lip_sync
from facecode_exporter.measures.lip_sync import Judge, Verdict
from facecode_exporter.measures.regions import LIPS
from facecode_exporter.measures.signals import Correlations, lag_correlations, pops

FROZEN = 1e-3
"""Of the template's diagonal: a mouth that opens less (0.4 mm of a head) does not move."""


@dataclass(frozen=True)
class Judged:
    """The phones of one kind, and the share that motion without regard to them would meet."""

    verdicts: list[Verdict]
    chance: float | None


@dataclass(frozen=True)
class Pops:
    """How much motion jumps: `signals.pops`, and how many times that of the reference."""

    value: float | None
    ratio: float | None


@dataclass(frozen=True, eq=False)
class SpokenClip:
    """One recording in one style."""

    recording: Recording
    style: str
    fps: float
    relative: Float32
    """(T,) opening of the mouth, 1 = full"""
    reference: Float32 | None
    """(T,) the same of the reference, where there is one"""
    closures: Judged
    openings: Judged
    rests: Judged
    correlations: Correlations | None
    """with the reference, of `lag_correlations`"""
    face_pops: Pops
    lip_pops: Pops | None
    """of the lips alone, where the bundle names them"""

    @property
    def verdicts(self) -> list[Verdict]:
        """All phones that were judged."""
        return [v for kind in (self.closures, self.openings, self.rests) for v in kind.verdicts]


def judge_speech(
    animator: Animator,
    recordings: Sequence[Recording],
    styles: Sequence[str],
    lip_pair: tuple[int, int],
    progress: Progress[tuple[Recording, str]],
    *,
    reference: ReferenceSource = lambda _, __: None,
    mode: Mode = "exact",
    window: int | None = None,
    samples: int | None = None,
) -> Iterator[SpokenClip]:
    """Animate every recording in every style, and measure.

    Args:
        animator: a bundle with a template.
        recordings: of `read_recordings`.
        styles: names that the bundle knows.
        lip_pair: of `require_lip_pair`.
        progress: wraps the list of work.
        reference: motion to compare with; none by default.
        mode: of `Animator.animate`.
        window: of `Animator.animate`.
        samples: how many faces of each, every one judged as the style `<style>-<face>`; by default
            one, as the style itself.
    """
    lips = animator.bundle.region(LIPS) if LIPS in animator.manifest.regions else None
    for recording, style in progress([(r, s) for s in styles for r in recordings]):
        compared = reference(recording, style)
        if samples is None:
            clip = animator.animate(recording.path, style, mode=mode, window=window)
            yield measure(clip, recording, style, lip_pair, lips, compared)
            continue
        faces = animator.animate(recording.path, style, mode=mode, window=window, samples=samples)
        for k, face in enumerate(faces):
            yield measure(face, recording, f"{style}-{k}", lip_pair, lips, compared)


def measure(
    clip: Animation,
    recording: Recording,
    style: str,
    lip_pair: tuple[int, int],
    lips: Indices | None = None,
    reference: Reference | None = None,
) -> SpokenClip:
    """All measures of one animation."""
    vertices, phones, fps = clip.vertices, recording.phones, clip.fps
    frozen = FROZEN * float(np.linalg.norm(np.ptp(clip.template, axis=0)))
    opening = lip_sync.opening_curve(vertices, lip_pair, clip.template)
    relative = lip_sync.relative_opening(opening, frozen)
    compared = None if reference is None else lip_sync.relative_opening(reference.opening)

    def judged(judge: Judge) -> Judged:
        return Judged(judge(phones, relative, fps), lip_sync.chance(judge, phones, relative, fps))

    def pops_of(region: Indices | slice) -> Pops:
        value = pops(vertices[:, region], fps)
        if reference is None or reference.vertices is None:
            return Pops(value, None)
        usual = pops(reference.vertices[:, region], fps)
        return Pops(value, value / usual if value is not None and usual else None)

    return SpokenClip(
        recording,
        style,
        fps,
        relative,
        compared,
        judged(lip_sync.closures),
        judged(lip_sync.openings),
        judged(lip_sync.rests),
        None if compared is None else lag_correlations(relative, compared),
        pops_of(slice(None)),
        None if lips is None else pops_of(lips),
    )


def require_lip_pair(animator: Animator, lip_pair: tuple[int, int] | None) -> tuple[int, int]:
    """The pair given, or the bundle's own.

    Raises:
        EvaluationError: neither, outside the mesh, or a bundle without a template.
    """
    manifest = animator.manifest
    pair = lip_pair or manifest.lip_pair
    if not manifest.has_template:
        raise EvaluationError(
            f"bundle {manifest.name} has no template, so the closed mouth is not known; "
            "export it again with --template"
        )
    if pair is None:
        raise EvaluationError(
            f"bundle {manifest.name} names no lip pair; give --lip-pair UPPER,LOWER, "
            "the vertices of the inner lips on the midline"
        )
    if len(set(pair)) != 2 or not all(0 <= v < manifest.n_vertices for v in pair):
        raise EvaluationError(
            f"got lip pair {pair}; expected two vertices below {manifest.n_vertices:,}"
        )
    return pair[0], pair[1]
