"""LVE, FDD and MVE: how far predicted motion is from captured motion.

Comes in: vertices (T, V, 3) of prediction and truth at the same rate, in the same unit. Goes out:
numbers. Knows nothing of files, rates or bundles.

Prediction and truth are compared over the frames that both have: the longer one loses its last
frames. (The public CodeTalker code cuts a longer prediction and stops at a shorter one.)
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from facecode.arrays import AnyArray, Template
from facecode_exporter.errors import EvaluationError
from facecode_exporter.measures.regions import Regions


@dataclass(frozen=True)
class Score:
    """One clip, or several pooled."""

    n_frames: int
    """compared"""
    lve: float
    """squared unit"""
    fdd: float
    """squared unit, signed: negative means that the prediction moves more"""
    mve: float
    """unit"""


def score(prediction: AnyArray, truth: AnyArray, template: Template, regions: Regions) -> Score:
    """All three metrics of one clip, over the frames that both have.

    Raises:
        EvaluationError: another number of vertices, or no frames.
    """
    prediction, truth = cut_to_shorter(prediction, truth)
    return Score(
        n_frames=len(truth),
        lve=lip_vertex_error(prediction, truth, regions.lips),
        fdd=face_dynamics_deviation(prediction, truth, template, regions.upper_face),
        mve=mean_vertex_error(prediction, truth),
    )


def pooled(scores: Iterable[Score]) -> Score:
    """Several clips as one number each, as the public CodeTalker code pools them.

    LVE (and MVE) are means over the frames of all clips together, so that a long clip counts for
    more; FDD is the plain mean over clips.

    Raises:
        EvaluationError: no clips.
    """
    clips = list(scores)
    if not clips:
        raise EvaluationError("no clips to score; expected at least one")
    frames = np.array([s.n_frames for s in clips], dtype=np.float64)

    def over_frames(values: Sequence[float]) -> float:
        return float(np.average(values, weights=frames))

    return Score(
        n_frames=int(frames.sum()),
        lve=over_frames([s.lve for s in clips]),
        fdd=float(np.mean([s.fdd for s in clips])),
        mve=over_frames([s.mve for s in clips]),
    )


def lip_vertex_error(prediction: AnyArray, truth: AnyArray, lips: AnyArray) -> float:
    """LVE = mean over t of max over v in `lips` of |prediction[t, v] - truth[t, v]|^2.

    Squared unit of the vertices. From MeshTalk (Richard et al., ICCV 2021); the square, which the
    papers leave out, is what the public FaceFormer and CodeTalker numbers are computed with.
    """
    difference = _float64(prediction, lips) - _float64(truth, lips)
    return float(np.square(difference).sum(axis=2).max(axis=1).mean())


def face_dynamics_deviation(
    prediction: AnyArray, truth: AnyArray, template: Template, upper_face: AnyArray
) -> float:
    """FDD = mean over v in `upper_face` of std_t |truth - template|^2 - std_t |pred - template|^2.

    std_t is the population standard deviation over the frames of the clip. Squared unit, signed
    (CodeTalker, Xing et al., CVPR 2023, section 4.2; the public code takes the square of the norm).
    """
    neutral = template[upper_face].astype(np.float64)

    def deviation(vertices: AnyArray) -> float:
        offsets = _float64(vertices, upper_face) - neutral
        return float(np.square(offsets).sum(axis=2).std(axis=0).mean())

    return deviation(truth) - deviation(prediction)


def mean_vertex_error(prediction: AnyArray, truth: AnyArray) -> float:
    """MVE = mean over t and all v of |prediction[t, v] - truth[t, v]|. Unit of the vertices."""
    frames = [
        np.linalg.norm(p.astype(np.float64) - t, axis=1).mean()
        for p, t in zip(prediction, truth, strict=True)
    ]
    return float(np.mean(frames))


def cut_to_shorter(prediction: AnyArray, truth: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Both without the last frames that only one has.

    Raises:
        EvaluationError: another number of vertices, or no frames.
    """
    if prediction.shape[1:] != truth.shape[1:]:
        raise EvaluationError(
            f"the prediction has {prediction.shape[1]:,} vertices, the truth {truth.shape[1]:,}; "
            "predict in the topology of the data set"
        )
    n_frames = min(len(prediction), len(truth))
    if not n_frames:
        raise EvaluationError(
            f"prediction and truth have {len(prediction)} and {len(truth)} frames; "
            "expected at least one in both"
        )
    return prediction[:n_frames], truth[:n_frames]


def _float64(vertices: AnyArray, region: AnyArray) -> AnyArray:
    return vertices[:, region].astype(np.float64)
