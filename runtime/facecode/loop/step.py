"""The step loop: codes of all parts, frame after frame, for many batch rows at once.

A batch row is one sample of one part of one clip. Rows lie clip by clip, and within a clip sample
by sample; a part has `n_samples` rows for each row of the part before it. Clips are in order of
falling length, so that those that have ended are cut off the end.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from facecode.arrays import AnyArray, Codes, Float32, Vectors
from facecode.loop.part import Codebook, Part
from facecode.loop.protocols import Final, MotionState, PartLoop
from facecode.speech import Memory, frames_of
from facecode_spec.graphs import condition_name

MORE_SLOTS = 32


@dataclass(frozen=True)
class Frame:
    """What one step of the loop gives."""

    codes: tuple[Codes, ...]
    """(n_clips, rows, H) of each part, for the clips that reach the frame; none after the last."""
    final: tuple[list[Final], ...]
    """Of each part, the hidden frames that have become final; none in `exact` mode."""


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
        self._part, self._memories, self._n_heads = part, memories, len(heads)
        self.restyle(weights)
        self._heads = np.tile(heads, len(weights))
        n_rows = len(self._heads)
        self._cache = KeyValueCache(part.n_layers, n_rows, part.dim, part.n_heads, longest_past)

    def rows(self, n_clips: int | None = None) -> int:
        """Batch rows of the first `n_clips` clips, or of all."""
        return len(self._heads) if n_clips is None else n_clips * self._n_heads

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


class GeneratedPart:
    """A part whose codes are predicted from speech: decoder step, nearest codes, feedback."""

    def __init__(self, codebook: Codebook, decoder: DecoderStep, motion: MotionState) -> None:
        self._codebook, self._decoder, self._motion = codebook, decoder, motion
        self._fed_back: Float32 | None = None

    def step(self, step: int, n_clips: int, conditions: Mapping[str, Vectors]) -> Codes:
        """See `PartLoop`."""
        motion, self._fed_back = self._fed_back, None
        if step and motion is None:
            motion = self._motion.feed_back(self._decoder.rows(n_clips))
        (features,) = self._decoder.run(("features",), step, n_clips, motion, conditions)
        codes = self._codebook.nearest(features)
        self._motion.append(self._codebook.look_up(codes))
        return codes

    def settle(self) -> None:
        """See `PartLoop`."""
        self._fed_back = self._motion.feed_back(self._decoder.rows())

    def restyle(self, weights: Float32) -> None:
        """See `PartLoop`."""
        self._decoder.restyle(weights)

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
        if part.codebook is not None:
            vectors[part.name] = part.codebook.look_up(rows)
        codes.append(rows.reshape(n_clips, len(rows) // n_clips, rows.shape[-1]))
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
