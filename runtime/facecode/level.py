"""The level of a clip, which wav2vec 2.0 wants gone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facecode.arrays import Audio

BLOCK = 1 << 20
"""Samples whose squares are held at once."""


def normalise(audio: Audio) -> Audio:
    """Zero mean and unit variance over the clip, as wav2vec 2.0 was trained on; see `Level`."""
    return Level.of(audio).apply(audio)


@dataclass(frozen=True)
class Level:
    """Mean and deviation of a clip, to normalise all of it or a piece at a time.

    `(x - mean) / sqrt(var + 1e-7)` with the population variance; sums in float64, so that an
    hour of audio is as exact as a second. Silence stays zero.
    """

    mean: np.float64
    deviation: np.float64

    @classmethod
    def of(cls, audio: Audio) -> Level:
        """Measure a clip (n_samples,)."""
        blocks = range(0, len(audio), BLOCK)
        mean = sum(audio[i : i + BLOCK].sum(dtype=np.float64) for i in blocks) / len(audio)
        squares = (np.square(audio[i : i + BLOCK] - mean, dtype=np.float64) for i in blocks)
        variance = sum(block.sum() for block in squares) / len(audio)
        return cls(np.float64(mean), np.sqrt(np.float64(variance) + 1e-7))

    def apply(self, audio: Audio) -> Audio:
        """The clip, or a piece of it, normalised."""
        normalised: Audio = ((audio - self.mean) / self.deviation).astype(np.float32)
        return normalised
