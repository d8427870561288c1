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


MORE_SLOTS = 32


class KeyValueCache:
    """Past keys and values of every self-attention layer, head by head, a slot a frame.

    With a `limit` the slots are a ring: the newest frame takes that of the oldest. They are handed
    over with the empty ones, which the graph ignores: without them rows would not be contiguous,
    and be copied at every step.
    """

    def __init__(
        self, n_layers: int, n_batch: int, dim: int, n_heads: int | None, limit: int | None = None
    ) -> None:
        """Empty; with a `limit`, of that many frames at most.

        `n_heads` None: rows of all heads without empty slots, the oldest frame first, (b, n, D), as
        older bundles want them.
        """
        self._limit, self._in_order = limit, n_heads is None
        self._heads = (n_heads or 1, dim // (n_heads or 1))
        n_heads, width = self._heads
        self._rows = np.zeros((2, n_layers, n_batch, n_heads, MORE_SLOTS, width), np.float32)
        self._n_frames = 0

    def append(self, keys: AnyArray, values: AnyArray) -> None:
        """Add the new rows of all layers: keys and values (n_layers, b, D)."""
        slot = self._n_frames if self._limit is None else self._n_frames % self._limit
        if slot == self._rows.shape[4]:
            self._grow()
        n = keys.shape[1]
        for kind, rows in zip(self._rows, (keys, values), strict=True):
            kind[:, :n, :, slot] = rows.reshape(*rows.shape[:2], *self._heads)
        self._n_frames += 1

    def _grow(self) -> None:
        n_slots = self._rows.shape[4]
        wanted = n_slots + max(MORE_SLOTS, n_slots // 8)
        n_new = wanted if self._limit is None else min(wanted, self._limit)
        grown = np.zeros((*self._rows.shape[:4], n_new, self._heads[1]), np.float32)
        grown[:, :, :, :, :n_slots] = self._rows
        self._rows = grown

    def inputs(self, n_batch: int | None = None) -> dict[str, AnyArray]:
        """The graph inputs `past_keys_i` and `past_values_i`, each (b, heads, n_slots, width)."""
        rows = self._rows[:, :, :n_batch]
        if self._in_order:
            rows = self._ordered(rows)
        kinds = zip(("past_keys", "past_values"), rows, strict=True)
        return {f"{kind}_{i}": layer for kind, layers in kinds for i, layer in enumerate(layers)}

    def _ordered(self, rows: AnyArray) -> AnyArray:
        """The filled slots of the one head, the oldest frame first."""
        n_filled = self._n_frames if self._limit is None else min(self._n_frames, self._limit)
        filled = rows[:, :, :, 0, :n_filled]
        has_wrapped = self._n_frames > n_filled
        return np.roll(filled, -(self._n_frames % n_filled), axis=3) if has_wrapped else filled
