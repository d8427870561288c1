"""Score predictions, or a bundle's own motion, against the truth of a data set, clip by clip.

Comes in: a data set and either a folder of predictions or an animator. Goes out: one scored clip
after the other. A subject that the model has learned from is judged in its own style alone, any
other in every style, as the public CodeTalker code does.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypeVar

from facecode.animator import Animator
from facecode.arrays import AnyArray, Codes
from facecode.options import Mode
from facecode_exporter.data.data_set import DataSet, subject_of
from facecode_exporter.data.motion_files import SUFFIXES, read_motion
from facecode_exporter.errors import EvaluationError
from facecode_exporter.measures.metrics import Score, score
from facecode_exporter.measures.regions import Regions, require_inside

CONDITION = "_condition_"
MOST_UNEQUAL, SPARE_FRAMES = 1.5, 5
"""Lengths that differ by a larger factor, and these frames, belong to different rates."""
T = TypeVar("T")
Progress = Callable[[Sequence[T]], Iterable[T]]


class Take(NamedTuple):
    """One clip of the data set in one style; a prediction need not name its style."""

    clip: str
    style: str | None


@dataclass(frozen=True)
class ScoredClip:
    """What one prediction is worth, and how many frames were not compared."""

    take: Take
    score: Score
    n_cut_prediction: int
    n_cut_truth: int
    codes: Codes | None = None
    """(T, H) where the prediction is a bundle's"""


def find_predictions(folder: Path, data: DataSet) -> Mapping[Take, Path]:
    """`<clip>.npy`, `<clip>_condition_<style>.npy`, or .npz, for the clips of `data`.

    Raises:
        EvaluationError: no folder, none for some clip, or two files for the same take.
    """
    if not folder.is_dir():
        raise EvaluationError(f"{folder} is no folder; expected one of <subject>_<sentence>.npy")
    found: dict[Take, Path] = {}
    for path in sorted(p for p in folder.glob("[!.]*") if p.suffix in SUFFIXES):
        clip, _, style = path.stem.partition(CONDITION)
        take = Take(clip, style or None)
        if take in found:
            raise EvaluationError(f"{found[take].name} and {path.name} predict the same clip")
        found[take] = path
    styles = {clip: [t.style for t in found if t.clip == clip] for clip in data.clips}
    if missing := [clip for clip in data.clips if not styles[clip]]:
        raise EvaluationError(
            f"{folder} predicts {len(data.clips) - len(missing)} of {len(data.clips)} clips; "
            f"it lacks {', '.join(missing[:3])}{', ...' if len(missing) > 3 else ''}. "
            "Predict them, or choose another --split"
        )
    return {
        Take(clip, style): found[Take(clip, style)]
        for clip in data.clips
        for style in _judged_styles(clip, styles[clip])
    }


def score_predictions(
    predictions: Mapping[Take, Path],
    data: DataSet,
    regions: Regions,
    progress: Progress[Take],
) -> Iterator[ScoredClip]:
    """Score files.

    Raises:
        EvaluationError: a file that does not fit the data set.
    """
    for take in progress(list(predictions)):
        n_vertices = len(data.template(take.clip))
        vertices = read_motion(predictions[take], n_vertices, data.layout.fps)
        yield scored_clip(take, vertices, data, regions)


def takes_of(data: DataSet, animator: Animator, styles: Sequence[str] | None) -> list[Take]:
    """What to animate: each clip in `styles`; by default in its own, or in all if it has none."""
    return [
        Take(clip, style)
        for clip in data.clips
        for style in (styles or _judged_styles(clip, animator.styles))
    ]


def score_animations(
    animator: Animator,
    takes: Sequence[Take],
    data: DataSet,
    regions: Regions,
    progress: Progress[Take],
    *,
    mode: Mode = "exact",
    window: int | None = None,
) -> Iterator[ScoredClip]:
    """Animate the speech of the data set on its subjects' own templates, and score.

    Raises:
        EvaluationError, FacecodeError: a bundle that does not fit the data set.
    """
    fps = animator.manifest.fps
    if data.layout.fps not in (None, fps):
        raise EvaluationError(
            f"the bundle moves at {fps:g} fps; this data set is scored at {data.layout.fps:g}"
        )
    for take in progress(takes):
        animation = animator.animate(
            data.speech(take.clip),
            take.style,
            mode=mode,
            window=window,
            template=data.template(take.clip),
        )
        scored = scored_clip(take, animation.vertices, data, regions)
        yield dataclasses.replace(scored, codes=animation.codes)


def _judged_styles(clip: str, styles: Sequence[T]) -> Sequence[T | str]:
    own = subject_of(clip)
    return [own] if own in styles else styles


def scored_clip(take: Take, vertices: AnyArray, data: DataSet, regions: Regions) -> ScoredClip:
    """Predicted vertices (T, V, 3) of a take against its truth.

    Raises:
        EvaluationError: another rate, topology, or no frames.
    """
    truth, template = data.truth(take.clip), data.template(take.clip)
    require_inside(regions, len(template))
    shorter, longer = sorted((len(vertices), len(truth)))
    if longer > MOST_UNEQUAL * shorter + SPARE_FRAMES:
        raise EvaluationError(
            f"{take.clip}: {len(vertices)} frames predicted, {len(truth)} captured; expected "
            "the same rate. VOCASET's 60 fps are halved by --dataset vocaset"
        )
    return ScoredClip(
        take,
        score(vertices, truth, template, regions),
        n_cut_prediction=len(vertices) - shorter,
        n_cut_truth=len(truth) - shorter,
    )
