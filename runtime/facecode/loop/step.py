"""The step loop: codes of all parts, frame after frame, for many batch rows at once.

A batch row is one sample of one part of one clip. Rows lie clip by clip, and within a clip sample
by sample; a part has `n_samples` rows for each row of the part before it. Clips are in order of
falling length, so that those that have ended are cut off the end.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

from facecode.arrays import Codes, Float32, Vectors
from facecode.loop.decoder_step import DecoderStep
from facecode.loop.part import Part
from facecode.loop.prior import Codebook

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


class GeneratedPart:
    """A part whose codes are predicted from speech: decoder step, nearest codes, feedback."""

    def __init__(self, codebook: Codebook, decoder: DecoderStep, motion: MotionState) -> None:
        self._codebook, self._decoder, self._motion = codebook, decoder, motion
        self._fed_back: Float32 | None = None

    def step(self, step: int, n_clips: int, conditions: Mapping[str, Vectors]) -> Codes:
        """See `PartLoop`."""
        motion = self._fed_back
        if step and motion is None:
            motion = self._motion.feed_back(self._decoder.rows(n_clips))
        self._fed_back = None
        (features,) = self._decoder.run(("features",), step, n_clips, motion, conditions)
        codes = self._codebook.nearest(features)
        self._motion.append(self._codebook.look_up(codes))
        return codes

    def settle(self) -> None:
        """See `PartLoop`."""
        self._fed_back = self._motion.feed_back(self._decoder.n_rows)

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
