"""What the step loop needs of a part, and a part with codes of its motion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, TypeAlias

from facecode.arrays import Codes, Float32, Vectors

Final: TypeAlias = "tuple[slice, Float32]"
"""Batch rows, and the hidden frames (rows, m, E) of theirs that follow those given before."""


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
