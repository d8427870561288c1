"""The loop of a part of kind `offsets`: its decoder predicts motion itself, without codes.

The decoder is causal throughout, so that a frame is final as soon as it is predicted, and the cost
of the next one does not grow but for self-attention over the past.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from facecode.arrays import Codes, Float32, Vectors
from facecode.loop.protocols import Final
from facecode.loop.step import DecoderStep


class OffsetsPart:
    """A part whose hidden frames are predicted from speech and from its motion so far."""

    def __init__(self, decoder: DecoderStep) -> None:
        self._decoder = decoder
        self._feedback: Float32 | None = None
        self._final: list[Final] = []

    def step(self, step: int, n_clips: int, conditions: Mapping[str, Vectors]) -> Codes:
        """See `PartLoop`: codes (rows, 0)."""
        n = self._decoder.rows(n_clips)
        motion = None if self._feedback is None else self._feedback[:n]
        outputs = ("hidden", "feedback")
        hidden, self._feedback = self._decoder.run(outputs, step, n_clips, motion, conditions)
        self._final.append((slice(0, n), hidden[:, None]))
        return np.empty((n, 0), np.int64)

    def settle(self) -> None:
        """See `PartLoop`: the step gives what is fed back."""

    def restyle(self, weights: Float32) -> None:
        """See `PartLoop`."""
        self._decoder.restyle(weights)

    def finish(self) -> None:
        """See `PartLoop`: every frame is final already."""

    def take_final(self) -> list[Final]:
        """See `PartLoop`."""
        final, self._final = self._final, []
        return final
