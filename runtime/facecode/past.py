"""Which frames of a past without end are kept: evenly spaced ones, each standing for several."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Float32

EMPTY = -1


class ThinnedPast:
    """A fixed number of slots for frames 0, s, 2s, ...; the stride s doubles when they are full.

    Attention without a mask takes a mean over all frames alike, and an even sample of them, each
    weighted by the stride, estimates it.
    """

    def __init__(self, n_slots: int) -> None:
        self.stride = 1
        self._frames = np.full(n_slots, EMPTY)
        self._next = 0

    def slot_for(self, frame: int) -> int | None:
        """The slot for a frame that has become past; None: it is not kept. Frames come in order."""
        if frame % self.stride == 0 and not (self._frames == EMPTY).any():
            self.stride *= 2
            self._frames[self._frames % self.stride != 0] = EMPTY
        if frame % self.stride:
            return None
        slot = int(np.argmax(self._frames == EMPTY))
        self._frames[slot] = frame
        return slot

    def log_weights(self) -> Float32:
        """(n_slots,) logarithm of how many frames each stands for; -inf for empty slots."""
        weights = np.where(self._frames == EMPTY, -np.inf, np.log(self.stride))
        return weights.astype(np.float32)

    def oldest_first(self, n: int) -> NDArray[np.int64]:
        """Up to `n` filled slots, those first that `advance` has left longest."""
        filled = np.flatnonzero(self._frames != EMPTY)
        turn = np.roll(filled, -int(np.searchsorted(filled, self._next)))
        return turn[:n]

    def advance(self, slots: NDArray[np.int64]) -> None:
        """Say that `slots` of `oldest_first` have been dealt with."""
        if len(slots):
            self._next = int(slots[-1]) + 1
