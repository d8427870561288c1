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


@dataclass(frozen=True)
class RunningLevel:
    """The level of a clip that is still spoken; what it gives depends on the order of pieces."""

    n_samples: int
    total: float
    squares: float

    @classmethod
    def of(cls, audio: Audio) -> RunningLevel:
        """Begin with a piece (n_samples,)."""
        return cls(0, 0.0, 0.0).with_more(audio)

    def with_more(self, audio: Audio) -> RunningLevel:
        """The level with a piece that follows."""
        wide = audio.astype(np.float64)
        return RunningLevel(
            self.n_samples + len(audio),
            self.total + float(wide.sum()),
            self.squares + float(np.square(wide).sum()),
        )

    @property
    def now(self) -> Level:
        """The level of all pieces so far."""
        mean = self.total / self.n_samples
        variance = max(0.0, self.squares / self.n_samples - mean * mean)
        return Level(np.float64(mean), np.sqrt(np.float64(variance) + 1e-7))
