"""How a stream hears: blocks of speech, each encoded with what came before and a little after."""

from __future__ import annotations

import math
from dataclasses import dataclass

from facecode.errors import LookAheadError
from facecode_spec.manifest import Manifest

CONTEXT_S = 1.0
"""Speech before a block that its encoding hears; more hardly changes the face."""
BLOCK_S = 0.1
DELAY_FRAMES = 1
"""Frames that follow a frame before it is shown; see docs/live.md."""
LEAST_MS, MOST_MS = 100, 2000
LOOK_AHEAD_MS = 200


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
        )

    @property
    def look_ahead_ms(self) -> float:
        """Speech after a block that its encoding hears."""
        return 1000 * self.look_ahead / self.fps

    @property
    def latency_ms(self) -> float:
        """What the first frame of a block waits for at most: look-ahead, block and show delay."""
        return 1000 * (self.look_ahead + self.block + self.delay) / self.fps

    def sample(self, frame: int) -> int:
        """Where `frame` begins in the waveform."""
        return math.floor(frame * self.rate / self.fps)
