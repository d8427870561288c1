"""A fixed-size sample of an unbounded past: every s-th frame, weighted by s."""

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
        self._cursor = 0

    def claim_slot(self, frame: int) -> int | None:
        """Claim a slot for `frame`; None: the frame is not kept. Frames come in order.

        When all slots are taken the stride doubles and every other frame is evicted.
        """
        if frame % self.stride == 0 and not (self._frames == EMPTY).any():
            self.stride *= 2
            self._frames[self._frames % self.stride != 0] = EMPTY
        if frame % self.stride:
            return None
        slot = int(np.argmax(self._frames == EMPTY))
        self._frames[slot] = frame
        return slot

    def log_weights(self) -> Float32:
        """(n_slots,) logarithm of the number of frames that each slot stands for; -inf if empty."""
        weights = np.where(self._frames == EMPTY, -np.inf, np.log(self.stride))
        return weights.astype(np.float32)

    def oldest_first(self, n: int) -> NDArray[np.int64]:
        """Up to `n` filled slots in round-robin order, from the cursor on."""
        filled = np.flatnonzero(self._frames != EMPTY)
        return np.roll(filled, -int(np.searchsorted(filled, self._cursor)))[:n]

    def advance(self, slots: NDArray[np.int64]) -> None:
        """Move the round-robin cursor past `slots`."""
        if len(slots):
            self._cursor = int(slots[-1]) + 1
