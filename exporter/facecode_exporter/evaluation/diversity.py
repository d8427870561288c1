"""APD, UPD, LPD, MPD and ALVE: how different several faces of one voice are, and how right.

Comes in: vertices (K, T, V, 3) of K faces of one clip and its truth. Goes out: numbers. From CDFace
(Gu et al. 2024). Distances are of whole clips, flattened over frames and vertices, so that longer
clips are further apart; unit of the vertices.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from facecode.animation import Animation
from facecode.animator import Animator
from facecode.arrays import AnyArray
from facecode_exporter.data.data_set import DataSet
from facecode_exporter.errors import EvaluationError
from facecode_exporter.evaluation.code_sampling import drawing, drawn_faces
from facecode_exporter.evaluation.distances import Progress, Take
from facecode_exporter.evaluation.plots import require_matplotlib, save_figure
from facecode_exporter.measures.lip_sync import opening_curve
from facecode_exporter.measures.metrics import cut_to_shorter, lip_vertex_error
from facecode_exporter.measures.regions import Regions


@dataclass(frozen=True)
class DiversityScore:
    """One clip, or the mean of several."""

    apd: float
    """mean distance of two faces"""
    upd: float
    """the same over upper-face vertices"""
    lpd: float
    """the same over lip vertices"""
    mpd: float
    """distance of the closest two faces; 0 where two are the same"""
    alve: float
    """LVE averaged over the faces, squared unit"""
    best_lve: float
    """LVE of the best face, squared unit"""


def diversity_score(faces: AnyArray, truth: AnyArray, regions: Regions) -> DiversityScore:
    """All numbers of one clip.

    Args:
        faces: vertices (K, T, V, 3), two faces or more.
        truth: (T, V, 3); the longer of both loses its last frames.
        regions: lips and upper face.

    Raises:
        EvaluationError: fewer than two faces, or another number of vertices.
    """
    if len(faces) < 2:
        raise EvaluationError(f"got {len(faces)} face; a distance needs two or more")
    cut = [cut_to_shorter(face, truth) for face in faces]
    shown, true = [face for face, _ in cut], cut[0][1]
    whole = pair_distances(shown, slice(None))
    errors = [lip_vertex_error(face, true, regions.lips) for face in shown]
    return DiversityScore(
        apd=float(np.mean(whole)),
        upd=float(np.mean(pair_distances(shown, regions.upper_face))),
        lpd=float(np.mean(pair_distances(shown, regions.lips))),
        mpd=float(np.min(whole)),
        alve=float(np.mean(errors)),
        best_lve=float(np.min(errors)),
    )


def pair_distances(faces: Sequence[AnyArray], region: AnyArray | slice) -> list[float]:
    """|X^i - X^j| of every pair of faces (T, V, 3), over the vertices of `region`."""
    flat = [face[:, region].astype(np.float64).ravel() for face in faces]
    return [float(np.linalg.norm(a - b)) for a, b in combinations(flat, 2)]


def mean_score(scores: Iterable[DiversityScore]) -> DiversityScore:
    """The plain mean over clips.

    Raises:
        EvaluationError: no clips.
    """
    rows = [asdict(score) for score in scores]
    if not rows:
        raise EvaluationError("no clips to score; expected at least one")
    return DiversityScore(**{name: float(np.mean([r[name] for r in rows])) for name in rows[0]})


def score_faces(
    animator: Animator,
    takes: Sequence[Take],
    data: DataSet,
    regions: Regions,
    n_faces: int,
    hold: str | None,
    progress: Progress[Take],
    tau: float | None = None,
) -> Iterator[tuple[Take, DiversityScore]]:
    """Animate the speech of a data set `n_faces` times, and score.

    Args:
        animator: a bundle with a part of several samples, or of one sample with `tau`.
        takes: of `takes_of`.
        data: captured or generated faces.
        regions: lips and upper face.
        n_faces: how many.
        hold: a part that keeps the codes of its first sample; None: all vary.
        progress: wraps the list of work.
        tau: the baseline instead, a model that draws its codes; see `code_sampling`.

    Raises:
        EvaluationError, SampleError, ModeError.
    """
    engine = None if tau is None else drawing(animator, tau)
    for take in progress(takes):
        speech, template = data.speech(take.clip), data.template(take.clip)
        if engine is not None:
            vertices = drawn_faces(animator, engine, speech, take.style, template, n_faces)
        else:
            held = None
            if hold is not None:
                held = {hold: animator.animate(speech, take.style, mode="exact")}
            vertices = animator.animate(
                speech, take.style, samples=n_faces, hold=held, template=template, mode="exact"
            ).vertices
        yield take, diversity_score(vertices, data.truth(take.clip), regions)


def plot_lip_distances(faces: Sequence[Animation], lip_pair: Sequence[int], path: Path) -> None:
    """Draw the opening of every face over time to a PNG: the paper's Fig. 7.

    Raises:
        MissingExtraError, OutputFolderError, OutputWriteError.
    """
    require_matplotlib()
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 3.5), layout="constrained")
    axes = figure.subplots()
    for k, face in enumerate(faces):
        opening = opening_curve(face.vertices, lip_pair, face.template)
        axes.plot(np.arange(len(opening)) / face.fps, opening, lw=1.2, label=f"sample {k}")
    axes.axhline(0, color="black", lw=0.6, ls=":")
    axes.set(xlabel="seconds", ylabel="lip distance less rest")
    axes.margins(x=0)
    figure.legend(loc="outside lower center", ncols=len(faces), frameon=False)
    save_figure(figure, path)
