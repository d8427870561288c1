"""State of the step loop: rows appended one a frame, read as a whole, hardly ever copied."""

from __future__ import annotations

import numpy as np

from facecode.arrays import AnyArray


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


MORE_SLOTS = 64


class KeyValueCache:
    """Past keys and values of every self-attention layer, a slot a frame.

    With a `limit` the slots are a ring: the newest frame takes that of the oldest. A batch is
    handed over with its empty slots, which the graph ignores: without them it would not be
    contiguous, and be copied at every step.
    """

    def __init__(
        self,
        n_layers: int,
        n_batch: int,
        dim: int,
        limit: int | None = None,
        in_order: bool = False,
    ) -> None:
        """Empty; with a `limit`, of that many frames at most.

        `in_order`: without empty slots, the oldest frame first, as older bundles want it.
        """
        self._limit, self._in_order = limit, in_order
        self._rows = np.zeros((2, n_layers, n_batch, MORE_SLOTS, dim), dtype=np.float32)
        self._n_frames = 0

    def append(self, keys: AnyArray, values: AnyArray) -> None:
        """Add the new rows of all layers: keys and values (n_layers, b, D)."""
        slot = self._n_frames if self._limit is None else self._n_frames % self._limit
        if slot == self._rows.shape[3]:
            self._grow()
        n = keys.shape[1]
        self._rows[0, :, :n, slot], self._rows[1, :, :n, slot] = keys, values
        self._n_frames += 1

    def _grow(self) -> None:
        n_slots = self._rows.shape[3]
        wanted = n_slots + max(MORE_SLOTS, n_slots // 4)
        n_new = wanted if self._limit is None else min(wanted, self._limit)
        shape = (*self._rows.shape[:3], n_new, self._rows.shape[4])
        grown = np.zeros(shape, dtype=np.float32)
        grown[:, :, :, :n_slots] = self._rows
        self._rows = grown

    def inputs(self, n_batch: int | None = None) -> dict[str, AnyArray]:
        """The graph inputs `past_keys_i` and `past_values_i`, each (b, n_slots, D)."""
        rows = self._rows[:, :, :n_batch]
        filled = self._n_frames if self._limit is None else min(self._n_frames, self._limit)
        if rows.shape[2] == 1 or self._in_order:
            rows = rows[:, :, :, :filled]
        if self._in_order and self._n_frames > filled:
            rows = np.roll(rows, -(self._n_frames % filled), axis=3)
        kinds = zip(("past_keys", "past_values"), rows, strict=True)
        return {f"{kind}_{i}": layer for kind, layers in kinds for i, layer in enumerate(layers)}
