"""How a stream hears: blocks of speech, each encoded with what came before and a little after."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from facecode.errors import LookAheadError
from facecode_spec.live import LiveEntry
from facecode_spec.manifest import Manifest, ModeEntry

CONTEXT_S = 1.0
"""Speech before a block that its encoding hears; more hardly changes the face."""
BLOCK_S = 0.1
DELAY_FRAMES = 1
"""Frames that follow a frame before it is shown; see docs/live.md."""
LEAST_MS, MOST_MS = 100, 2000
LOOK_AHEAD_MS = 200
ENCODER_HZ = 50
"""Rows a second of Whisper and wav2vec 2.0. Of a window that ends within a row they make one less,
and spread the rest over all of its frames: the last ones come up to 36 ms early."""
LONGEST_PERIOD = 12
"""Frames in which a whole number of rows is sought; rates such as 29.97 find none."""


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
        live = live_entry(manifest)
        wanted = live.look_ahead_ms if look_ahead_ms is None else look_ahead_ms
        if not LEAST_MS <= wanted <= MOST_MS:
            raise LookAheadError(
                f"got a look-ahead of {wanted} ms; expected {LEAST_MS} to {MOST_MS}"
            )
        fps = manifest.fps
        look_ahead = round(wanted / 1000 * fps)
        block = max(1, math.floor(live.block_s * fps + 0.5))
        context = round(live.context_s * fps)
        context += -(context + block + look_ahead) % _whole_rows(fps)
        return cls(fps, manifest.sample_rate, look_ahead, block, context, live.delay_frames)

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


def live_entry(manifest: Manifest) -> LiveEntry:
    """How the bundle is streamed, by its own choice or by that of this runtime."""
    delay = 0 if is_causal(manifest.modes) else DELAY_FRAMES
    return manifest.live or LiveEntry(CONTEXT_S, BLOCK_S, delay, LOOK_AHEAD_MS)


def _whole_rows(fps: float) -> int:
    """The fewest frames that take a whole number of the encoder's rows; 1 if they are many."""
    period = (ENCODER_HZ / Fraction(fps)).denominator
    return period if period <= LONGEST_PERIOD else 1


def is_causal(modes: Mapping[str, ModeEntry]) -> bool:
    """Whether a frame is final when it is predicted, as without codes."""
    return "exact" in modes and modes["exact"].delay_frames == 0
