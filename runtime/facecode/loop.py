"""The step loop: codes of all parts, frame after frame, for many rows at once.

A row is one sample of one part of one clip. Rows lie clip by clip, and within a clip sample by
sample; a part has `n_samples` rows for each row of the part before it. Clips are in order of
falling length, so that those that have ended are cut off the end.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Protocol

import numpy as np

from facecode.arrays import AnyArray, Codes, Float32, Vectors
from facecode.buffers import KeyValueCache
from facecode.part import Part
from facecode.speech import Memory, frames_of
from facecode_spec.graphs import condition


class PartLoop(Protocol):
    """One part's progress through the frames of all clips."""

    def step(self, step: int, n_clips: int, conditions: Mapping[str, Vectors]) -> Codes:
        """Codes (rows, H) of frame `step` for the rows of the first `n_clips` clips."""

    def finish(self) -> None:
        """Say that no frame follows."""


class MotionState(Protocol):
    """What the rows of a part have moved so far, and the embedding of the newest motion."""

    @property
    def longest_past(self) -> int | None:
        """Frames that self-attention looks back at most; None: all."""

    def append(self, vectors: Vectors) -> None:
        """Add the code vectors (rows, H, C) of one frame."""

    def feed_back(self, n: int) -> Float32:
        """(n, D) for the first `n` rows, before the next frame; the others have ended."""

    def finish(self) -> None:
        """In place of `feed_back`: no frame follows."""


class GeneratedPart:
    """A part that listens: decoder step, nearest codes, motion fed back."""

    def __init__(
        self,
        part: Part,
        memories: Sequence[Memory],
        weights: Float32,
        samples: AnyArray,
        motion: MotionState,
    ) -> None:
        """Begin at frame 0.

        Args:
            part: the part.
            memories: of clips of falling length.
            weights: style weights (n_clips, n_styles).
            samples: (rows of a clip,) which head answers for each of a clip's rows.
            motion: of as many rows.
        """
        n_rows = len(weights) * len(samples)
        self._part, self._motion, self._rows = part, motion, len(samples)
        self._memories = memories
        self._weights = np.repeat(weights, len(samples), axis=0)
        self._samples = np.tile(samples, len(weights))
        self._cache = KeyValueCache(
            part.n_layers, n_rows, part.dim, part.past_heads, motion.longest_past
        )

    def step(self, step: int, n_clips: int, conditions: Mapping[str, Vectors]) -> Codes:
        """See `PartLoop`."""
        part, n = self._part, n_clips * self._rows
        motion = np.zeros((n, part.dim), dtype=np.float32)
        if step:
            motion = self._motion.feed_back(n)
        inputs = {name: _repeated(conditions[name], n) for name in part.conditions_on}
        heard = frames_of(self._memories[:n_clips], step)
        features, keys, values = part.decoder_step.run(
            ("features", "keys", "values"),
            motion=motion,
            style=self._weights[:n],
            step=np.array(step),
            **({"sample": self._samples[:n]} if part.n_samples > 1 else {}),
            **{condition(name): vectors for name, vectors in inputs.items()},
            **{name: _repeated(heard[name], n) for name in part.memory},
            **self._cache.inputs(n),
        )
        self._cache.append(keys, values)
        codes = part.codebook.nearest(features)
        self._motion.append(part.codebook.look_up(codes))
        return codes

    def finish(self) -> None:
        """See `PartLoop`."""
        self._motion.finish()


class HeldPart:
    """A part whose codes are given: (n_clips, T, H), one row a clip."""

    def __init__(self, codes: Codes) -> None:
        self._codes = codes

    def step(self, step: int, n_clips: int, conditions: Mapping[str, Vectors]) -> Codes:  # noqa: ARG002
        """See `PartLoop`."""
        return self._codes[:n_clips, step]

    def finish(self) -> None:
        """See `PartLoop`."""


def run_loop(
    parts: Sequence[Part], loops: Sequence[PartLoop], lengths: Sequence[int]
) -> Iterator[list[Codes]]:
    """Codes (n_clips, rows, H) of every part for frame 0, 1, ..., of the clips that reach it.

    Args:
        parts: in the order in which they condition on each other.
        loops: one a part.
        lengths: frames of each clip, falling.
    """
    for step in range(lengths[0]):
        n_clips = sum(length > step for length in lengths)
        vectors: dict[str, Vectors] = {}
        frame = []
        for part, loop in zip(parts, loops, strict=True):
            codes = loop.step(step, n_clips, vectors)
            vectors[part.name] = part.codebook.look_up(codes)
            frame.append(codes.reshape(n_clips, -1, codes.shape[-1]))
        yield frame
    for loop in loops:
        loop.finish()


def _repeated(rows: AnyArray, n: int) -> AnyArray:
    """Rows of clips, or of a part before, for each of the `n` rows that descend from them."""
    return rows if len(rows) == n else np.repeat(rows, n // len(rows), axis=0)
