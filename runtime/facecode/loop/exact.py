"""How a part's motion is fed back in `exact` mode: the whole prefix, decoded again at every step.

The convolution reaches a few frames ahead, so that all but the newest frames' outputs are final
and kept; the norm over the prefix and the attention change everything behind it.
"""

from __future__ import annotations

import numpy as np

from facecode.arrays import AnyArray, Float32, Vectors
from facecode.loop.part import MotionDecoder
from facecode.loop.protocols import Final


class PrefixMotion:
    """The code vectors of a growing prefix, and the embedding of the motion of its last frame."""

    longest_past = None

    def __init__(self, decoder: MotionDecoder, n_rows: int, vector_shape: tuple[int, ...]) -> None:
        self._decoder = decoder
        self._vectors = GrowingBuffer(n_rows, vector_shape)
        self._known = GrowingBuffer(n_rows, (decoder.dim,))

    def append(self, vectors: Vectors) -> None:
        """Add the code vectors (rows, H, C) of one frame."""
        self._vectors.append(vectors)

    def feed_back(self, n: int) -> Float32:
        """(n, D) for the first `n` rows; to be called after every frame."""
        prefix = self._vectors.view(n_batch=n)
        start = max(0, prefix.shape[1] - self._decoder.n_newest)
        feedback, activations = self._decoder.run(
            ("feedback", "activations"),
            prefix[:, start:],
            np.array([prefix.shape[1] - 1]),
            context=self._decoder.context(prefix, start),
            known=self._known.view(n_batch=n),
        )
        if activations.shape[1] == self._decoder.n_newest:
            self._known.append(activations[:, 0])
        return feedback

    def finish(self) -> None:
        """See `MotionState`: the clip is decoded as a whole when its codes are known."""

    def take_final(self) -> list[Final]:
        """See `MotionState`: no frame is final before the clip ends."""
        return []


class GrowingBuffer:
    """An array that grows along its second axis; capacity doubles when it is full.

    `view()` of a batch of one is contiguous, so that a graph reads it where it lies.
    """

    def __init__(self, n_batch: int, row_shape: tuple[int, ...], capacity: int = 64) -> None:
        self._data = np.empty((n_batch, capacity, *row_shape), dtype=np.float32)
        self.n_rows = 0

    def append(self, rows: AnyArray) -> None:
        """Add one row per batch item, or to the first `len(rows)` of them: (b, *row_shape)."""
        if self.n_rows == self._data.shape[1]:
            grown = np.empty(
                (len(self._data), 2 * self.n_rows, *self._data.shape[2:]), self._data.dtype
            )
            grown[:, : self.n_rows] = self._data
            self._data = grown
        self._data[: len(rows), self.n_rows] = rows
        self.n_rows += 1

    def view(self, n_batch: int | None = None) -> AnyArray:
        """The rows so far of the first `n_batch`: (b, n, *row_shape)."""
        return self._data[:n_batch, : self.n_rows]
