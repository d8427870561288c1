"""State of the step loop: rows appended one a frame, read as a whole, never copied per step."""

from __future__ import annotations

import numpy as np

from facecode.arrays import AnyArray


class GrowingBuffer:
    """An array that grows along its second axis; capacity doubles when it is full.

    `view()` of a batch of one is contiguous, so that a graph reads it where it lies. With a
    `limit` the last `limit` rows are kept, moved to the front when twice as many are full.
    """

    def __init__(
        self,
        n_batch: int,
        row_shape: tuple[int, ...],
        capacity: int = 64,
        limit: int | None = None,
    ) -> None:
        if limit is not None:
            capacity = 2 * limit
        self._limit = limit
        self._data = np.empty((n_batch, capacity, *row_shape), dtype=np.float32)
        self.n_rows = 0

    def append(self, rows: AnyArray) -> None:
        """Add one row per batch item, or to the first `len(rows)` of them: (b, *row_shape)."""
        if self.n_rows == self._data.shape[1]:
            self._make_room()
        self._data[: len(rows), self.n_rows] = rows
        self.n_rows += 1

    def _make_room(self) -> None:
        if self._limit is not None:
            self._data[:, : self._limit] = self._data[:, -self._limit :]
            self.n_rows = self._limit
        else:
            grown = np.empty(
                (len(self._data), 2 * self.n_rows, *self._data.shape[2:]), self._data.dtype
            )
            grown[:, : self.n_rows] = self._data
            self._data = grown

    def view(self, n_batch: int | None = None) -> AnyArray:
        """The rows so far, or the last `limit`, of the first `n_batch`: (b, n, *row_shape)."""
        start = 0 if self._limit is None else max(0, self.n_rows - self._limit)
        return self._data[:n_batch, start : self.n_rows]


class KeyValueCache:
    """Past keys and values of every self-attention layer, one buffer per layer and kind."""

    def __init__(self, n_layers: int, n_batch: int, dim: int, limit: int | None = None) -> None:
        """Empty; with a `limit`, of that many frames at most."""
        self._keys = [GrowingBuffer(n_batch, (dim,), limit=limit) for _ in range(n_layers)]
        self._values = [GrowingBuffer(n_batch, (dim,), limit=limit) for _ in range(n_layers)]

    def append(self, keys: AnyArray, values: AnyArray) -> None:
        """Add the new rows of all layers: keys and values (n_layers, b, D)."""
        for buffers, rows in ((self._keys, keys), (self._values, values)):
            for buffer, row in zip(buffers, rows, strict=True):
                buffer.append(row)

    def inputs(self, n_batch: int | None = None) -> dict[str, AnyArray]:
        """The graph inputs `past_keys_i` and `past_values_i`, each (b, n_past, D)."""
        views = [(b.view(n_batch=n_batch), "past_keys", i) for i, b in enumerate(self._keys)]
        views += [(b.view(n_batch=n_batch), "past_values", i) for i, b in enumerate(self._values)]
        return {f"{name}_{i}": view for view, name, i in views}
