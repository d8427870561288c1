"""How a stream hears: blocks of speech, each encoded with what came before and a little after."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from facecode.errors import LookAheadError
from facecode_spec.manifest import Manifest, ModeEntry

CONTEXT_S = 1.0
"""Speech before a block that its encoding hears; more hardly changes the face."""
BLOCK_S = 0.1
DELAY_FRAMES = 1
"""Frames that follow a frame before it is shown; see docs/live.md."""
LEAST_MS, MOST_MS = 100, 2000
LOOK_AHEAD_MS = 200


@dataclass(frozen=True)
class Window:
    """A piece of the waveform, and which of its frames are kept."""

    start: int
    stop: int
    kept_from: int
    """The block, or in the last window all that follows, begins at this frame of the window."""
    is_last: bool


@dataclass(frozen=True)
class Plan:
    """Lengths in frames of the motion, at `fps`."""

    fps: float
    rate: int
    """Of the waveform, Hz."""
    look_ahead: int
    """Frames after a block that its encoding hears."""
    block: int
    context: int
    delay: int = DELAY_FRAMES

    @classmethod
    def of(cls, manifest: Manifest, look_ahead_ms: float | None = None) -> Plan:
        """The plan for a bundle; the look-ahead is rounded to whole frames.

        Raises:
            LookAheadError: less than the encoder needs, or more than a stream is for.
        """
        wanted = LOOK_AHEAD_MS if look_ahead_ms is None else look_ahead_ms
        if not LEAST_MS <= wanted <= MOST_MS:
            raise LookAheadError(
                f"got a look-ahead of {wanted} ms; expected {LEAST_MS} to {MOST_MS}"
            )
        fps = manifest.fps
        return cls(
            fps,
            manifest.sample_rate,
            look_ahead=round(wanted / 1000 * fps),
            block=max(1, math.floor(BLOCK_S * fps + 0.5)),
            context=round(CONTEXT_S * fps),
            delay=0 if is_causal(manifest.modes) else DELAY_FRAMES,
        )

    @property
    def look_ahead_ms(self) -> float:
        """Speech after a block that its encoding hears."""
        return 1000 * self.look_ahead / self.fps

    @property
    def latency_ms(self) -> float:
        """What the first frame of a block waits for at most: look-ahead, block and show delay."""
        return 1000 * (self.look_ahead + self.block + self.delay) / self.fps

    def needed(self, frame: int) -> int:
        """Samples that must have been heard before the block that begins at `frame` is encoded."""
        return self.sample(frame + self.block + self.look_ahead)

    def window(self, frame: int, n_samples: int) -> Window | None:
        """What is encoded for the block that begins at `frame`, of `n_samples` in all.

        The last window, after which nothing is heard, begins at a whole second: there a frame
        begins too, and a recording has as many frames as in one pass. None: nothing is left.
        """
        first, stop = max(0, frame - self.context), self.needed(frame)
        is_last = stop > n_samples
        if is_last:
            first = round(math.floor(first / self.fps) * self.fps)
            stop = n_samples
        if self.sample(frame) >= stop:
            return None
        return Window(self.sample(first), stop, frame - first, is_last)

    def sample(self, frame: int) -> int:
        """Where `frame` begins in the waveform."""
        return math.floor(frame * self.rate / self.fps)


def is_causal(modes: Mapping[str, ModeEntry]) -> bool:
    """Whether a frame is final when it is predicted, as without codes."""
    return "exact" in modes and modes["exact"].delay_frames == 0
