"""The decoder step of a part, once a frame for many batch rows, and the past that it attends to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from facecode.arrays import AnyArray, Float32, Vectors
from facecode.loop.part import Part
from facecode.speech import Memory, frames_of
from facecode_spec.graphs import condition_name

MORE_SLOTS = 32


class KeyValueCache:
    """Past keys and values of every self-attention layer, head by head, a slot a frame.

    With a `limit` the slots are a ring: the newest frame takes the slot of the oldest. They are
    handed over with the empty ones, which the graph ignores: without them rows would not be
    contiguous, and be copied at every step.
    """

    def __init__(
        self, n_layers: int, n_batch: int, dim: int, n_heads: int, limit: int | None = None
    ) -> None:
        """Empty; with a `limit`, of that many frames at most."""
        self._limit = limit
        self._heads = (n_heads, dim // n_heads)
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
        kinds = zip(("past_keys", "past_values"), self._rows[:, :, :n_batch], strict=True)
        return {f"{kind}_{i}": layer for kind, layers in kinds for i, layer in enumerate(layers)}


class DecoderStep:
    """The decoder step of a part over the rows of all clips, with keys and values of their past."""

    def __init__(
        self,
        part: Part,
        memories: Sequence[Memory],
        weights: Float32,
        heads: AnyArray,
        longest_past: int | None = None,
    ) -> None:
        """Begin at frame 0.

        Args:
            part: the part.
            memories: of clips of falling length.
            weights: style weights (n_clips, n_styles).
            heads: (rows of a clip,) int64, which head gives each of a clip's rows.
            longest_past: frames that self-attention looks back at most; None: all.
        """
        n_rows = len(weights) * len(heads)
        self._part, self._memories, self._n_heads = part, memories, len(heads)
        self.restyle(weights)
        self._heads = np.tile(heads, len(weights))
        self._cache = KeyValueCache(part.n_layers, n_rows, part.dim, part.n_heads, longest_past)

    def rows(self, n_clips: int) -> int:
        """Batch rows of the first `n_clips` clips."""
        return n_clips * self._n_heads

    @property
    def n_rows(self) -> int:
        """Batch rows of all clips."""
        return len(self._weights)

    def restyle(self, weights: Float32) -> None:
        """Take style weights (n_clips, n_styles) for the frames to come."""
        self._weights = np.repeat(weights, self._n_heads, axis=0)

    def run(
        self,
        outputs: Sequence[str],
        step: int,
        n_clips: int,
        motion: Float32 | None,
        conditions: Mapping[str, Vectors],
    ) -> list[AnyArray]:
        """The `outputs` of frame `step`; `motion` (rows, D) is fed back, None at frame 0."""
        part, n = self._part, self.rows(n_clips)
        memory = frames_of(self._memories[:n_clips], step)
        *predicted, keys, values = part.decoder_step.run(
            (*outputs, "keys", "values"),
            motion=np.zeros((n, part.dim), np.float32) if motion is None else motion,
            style=self._weights[:n],
            step=np.array(step),
            **({"sample": self._heads[:n]} if part.n_samples > 1 else {}),
            **{condition_name(p): _repeated(conditions[p], n) for p in part.conditions_on},
            **{name: _repeated(memory[name], n) for name in part.memory},
            **self._cache.inputs(n),
        )
        self._cache.append(keys, values)
        return predicted


def _repeated(rows: AnyArray, n: int) -> AnyArray:
    """Rows of clips, or of a part before, for each of the `n` rows that descend from them."""
    return rows if len(rows) == n else np.repeat(rows, n // len(rows), axis=0)
