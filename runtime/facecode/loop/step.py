"""The step loop: codes of all parts, frame after frame, for many batch rows at once.

A batch row is one sample of one part of one clip. Rows lie clip by clip, and within a clip sample
by sample; a part has `n_samples` rows for each row of the part before it. Clips are in order of
falling length, so that those that have ended are cut off the end.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np

from facecode.arrays import AnyArray, Codes, Float32, Vectors
from facecode.loop.part import Part
from facecode.speech import Memory, frames_of
from facecode_spec.graphs import condition_name

MORE_SLOTS = 32

Final: TypeAlias = "tuple[slice, Float32]"
"""Batch rows, and the hidden frames (rows, m, E) of theirs that follow those given before."""


@dataclass(frozen=True)
class Frame:
    """What one step of the loop gives."""

    codes: tuple[Codes, ...]
    """(n_clips, rows, H) of each part, for the clips that reach the frame; none after the last."""
    final: tuple[list[Final], ...]
    """Of each part, the hidden frames that have become final; none in `exact` mode."""


class PartLoop(Protocol):
    """One part's progress through the frames of all clips."""

    def step(self, step: int, n_clips: int, conditions: Mapping[str, Vectors]) -> Codes:
        """Codes (rows, H) of frame `step` for the rows of the first `n_clips` clips."""

    def settle(self) -> None:
        """Feed the newest motion back now, not at the next frame: a stream does not wait for it."""

    def restyle(self, weights: Float32) -> None:
        """Take style weights (n_clips, n_styles) for the frames to come."""

    def finish(self) -> None:
        """Make the last frames final: no frame follows, or not soon."""

    def take_final(self) -> list[Final]:
        """The hidden frames that have become final since the last call."""


class MotionState(Protocol):
    """How the rows of a part have moved so far, and the embedding of the newest motion."""

    @property
    def longest_past(self) -> int | None:
        """Frames that self-attention looks back at most; None: all."""

    def append(self, vectors: Vectors) -> None:
        """Add the code vectors (rows, H, C) of one frame."""

    def feed_back(self, n: int) -> Float32:
        """(n, D) for the first `n` rows, before the next frame; the others have ended."""

    def finish(self) -> None:
        """In place of `feed_back`: no frame follows."""

    def take_final(self) -> list[Final]:
        """See `PartLoop`."""


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


class GeneratedPart:
    """A part whose codes are predicted from speech: decoder step, nearest codes, feedback."""

    def __init__(
        self,
        part: Part,
        memories: Sequence[Memory],
        weights: Float32,
        heads: AnyArray,
        motion: MotionState,
    ) -> None:
        """Begin at frame 0.

        Args:
            part: the part.
            memories: of clips of falling length.
            weights: style weights (n_clips, n_styles).
            heads: (rows of a clip,) int64, which head gives each of a clip's rows.
            motion: of as many rows.
        """
        n_rows = len(weights) * len(heads)
        self._part, self._motion, self._n_rows = part, motion, len(heads)
        self._memories = memories
        self._fed_back: Float32 | None = None
        self.restyle(weights)
        self._heads = np.tile(heads, len(weights))
        self._cache = KeyValueCache(
            part.n_layers, n_rows, part.dim, part.n_heads, motion.longest_past
        )

    def step(self, step: int, n_clips: int, conditions: Mapping[str, Vectors]) -> Codes:
        """See `PartLoop`."""
        part, n = self._part, n_clips * self._n_rows
        motion = np.zeros((n, part.dim), dtype=np.float32)
        if step:
            motion = self._motion.feed_back(n) if self._fed_back is None else self._fed_back
        self._fed_back = None
        memory = frames_of(self._memories[:n_clips], step)
        features, keys, values = part.decoder_step.run(
            ("features", "keys", "values"),
            motion=motion,
            style=self._weights[:n],
            step=np.array(step),
            **({"sample": self._heads[:n]} if part.n_samples > 1 else {}),
            **{condition_name(p): _repeated(conditions[p], n) for p in part.conditions_on},
            **{name: _repeated(memory[name], n) for name in part.memory},
            **self._cache.inputs(n),
        )
        self._cache.append(keys, values)
        codes = part.codebook.nearest(features)
        self._motion.append(part.codebook.look_up(codes))
        return codes

    def settle(self) -> None:
        """See `PartLoop`."""
        self._fed_back = self._motion.feed_back(len(self._weights))

    def restyle(self, weights: Float32) -> None:
        """See `PartLoop`."""
        self._weights = np.repeat(weights, self._n_rows, axis=0)

    def finish(self) -> None:
        """See `PartLoop`."""
        self._motion.finish()

    def take_final(self) -> list[Final]:
        """See `PartLoop`."""
        return self._motion.take_final()


def run_step(
    parts: Sequence[Part], loops: Sequence[PartLoop], step: int, n_clips: int
) -> tuple[Codes, ...]:
    """Codes (n_clips, rows, H) of each part for one frame of the first `n_clips` clips."""
    vectors: dict[str, Vectors] = {}
    codes = []
    for part, loop in zip(parts, loops, strict=True):
        rows = loop.step(step, n_clips, vectors)
        vectors[part.name] = part.codebook.look_up(rows)
        codes.append(rows.reshape(n_clips, -1, rows.shape[-1]))
    return tuple(codes)


def run_loop(
    parts: Sequence[Part], loops: Sequence[PartLoop], lengths: Sequence[int]
) -> Iterator[Frame]:
    """Frame 0, 1, ... of the clips that reach it, and what becomes final when they have ended.

    Args:
        parts: in the order in which they condition on each other.
        loops: one a part.
        lengths: frames of each clip, falling.
    """
    for step in range(lengths[0]):
        codes = run_step(parts, loops, step, sum(length > step for length in lengths))
        yield Frame(codes, tuple(loop.take_final() for loop in loops))
    for loop in loops:
        loop.finish()
    yield Frame((), tuple(loop.take_final() for loop in loops))


def _repeated(rows: AnyArray, n: int) -> AnyArray:
    """Rows of clips, or of a part before, for each of the `n` rows that descend from them."""
    return rows if len(rows) == n else np.repeat(rows, n // len(rows), axis=0)


def with_bar(frames: Iterator[Frame], n_frames: int, shown: bool) -> Iterator[Frame]:
    """The same frames, with a bar on stderr if `shown`."""
    if not shown:
        yield from frames
        return
    from tqdm import tqdm

    with tqdm(total=n_frames, desc="animate", unit="frame") as bar:
        for frame in frames:
            bar.update(bool(frame.codes))
            yield frame
