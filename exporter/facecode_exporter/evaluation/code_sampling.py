"""The baseline of several faces: a model with one answer that draws its codes.

Comes in: an animator of parts with one sample each. Goes out: vertices of K faces of one recording.
Codes are drawn from a softmax over minus the squared distances to the codebook rows / tau, frame
after frame, each face on its own past.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from facecode.animator import Animator
from facecode.arrays import Codes, Features, Float32, Template
from facecode.audio import AudioSource, load_audio
from facecode.loop.engine import Engine
from facecode.loop.part import Codebook
from facecode.loop.request import style_weights
from facecode.options import Style
from facecode_exporter.errors import EvaluationError


class DrawnCodebook(Codebook):
    """A codebook whose `nearest` is a draw; tau 0 is the nearest row."""

    def __init__(self, rows: Float32, tau: float, rng: np.random.Generator) -> None:
        """Take rows (N, C); `tau` is in squared units of theirs."""
        super().__init__(rows)
        self.tau, self.rng = tau, rng

    def nearest(self, features: Features) -> Codes:
        """Features (..., C) to drawn codes (...) int64."""
        if self.tau == 0:
            return super().nearest(features)
        wide = features.astype(np.float64)
        squared = np.square(wide).sum(axis=-1, keepdims=True) + 2 * (
            self._half_norms - wide @ self._columns
        )
        noise = self.rng.gumbel(size=squared.shape)  # argmax of logits + Gumbel noise is a draw
        return np.asarray((noise - squared / self.tau).argmax(axis=-1))


def drawing(animator: Animator, tau: float, seed: int = 0) -> Engine:
    """The engine of `animator`, drawing its codes.

    Raises:
        EvaluationError: parts that have samples of their own, or a negative tau.
        NoCodesError: a part without codes.
    """
    engine = animator.engine
    if tau < 0 or any(part.n_samples > 1 for part in engine.parts):
        raise EvaluationError(
            f"got tau {tau:g} for {animator.manifest.name}; expected 0 or more, and a model that "
            "has no samples of its own"
        )
    rng = np.random.default_rng(seed)
    parts = tuple(
        dataclasses.replace(part, codebook=DrawnCodebook(part.prior[0].rows, tau, rng))
        for part in engine.parts
    )
    return dataclasses.replace(engine, parts=parts)


def drawn_faces(
    animator: Animator,
    engine: Engine,
    speech: AudioSource,
    style: Style | None,
    template: Template,
    n_faces: int,
) -> Float32:
    """Vertices (K, T, V, 3) of K faces, by the engine of `drawing`."""
    memory = engine.encode(load_audio(speech, animator.manifest.sample_rate))
    weights = np.tile(style_weights(style, animator.styles), (n_faces, 1))
    motions = engine.move([memory] * n_faces, engine.request(weights))
    return np.concatenate([offsets for _, offsets in motions]) + template
