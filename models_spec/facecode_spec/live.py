"""How a bundle hears a stream, and how far its frames are from those of whole recordings."""

from __future__ import annotations

from dataclasses import dataclass

from facecode_spec.plain import SpecError


@dataclass(frozen=True)
class Count:
    """How many of `n` sounds are met by the lips as they demand."""

    n: int
    met: int


@dataclass(frozen=True)
class LipCounts:
    """Sounds that were judged; docs/evaluation.md says how."""

    closures: Count
    """P, B and M."""
    openings: Count
    """Open vowels."""
    rests: Count
    """Silences."""


@dataclass(frozen=True)
class LiveDeviation:
    """Streams of one look-ahead against mode `exact`."""

    look_ahead_ms: float
    opening_r: float | None
    """Pearson's r of the lip opening over all frames; null: lips that do not move."""
    acceleration_ratio: float | None
    """99th percentile over frames of the vertices' acceleration, as a multiple."""
    lips: LipCounts


@dataclass(frozen=True)
class LiveMeasure:
    """What was measured, on recordings that were streamed and animated as a whole."""

    n_recordings: int
    seconds: float
    style: str
    exact: LipCounts
    """Of the whole recordings."""
    look_aheads: tuple[LiveDeviation, ...]


@dataclass(frozen=True)
class LiveEntry:
    """How a stream hears by default: blocks of speech, each with some before and after it."""

    context_s: float
    """Before a block."""
    block_s: float
    delay_frames: int
    """Frames that follow a frame before it is shown; 0 for a system without codes."""
    look_ahead_ms: float
    """After a block, where nothing else is asked for."""
    primer: str | None = None
    """.npy, float32 (n,) of whole seconds at the bundle's rate: the speech that every stream begins
    after; null: the runtime's own."""
    measured: LiveMeasure | None = None
    """null: not measured."""

    def __post_init__(self) -> None:
        fits = 0 <= self.context_s <= 30 and 0 < self.block_s <= 2 and self.look_ahead_ms > 0
        if not fits or self.delay_frames < 0:
            raise SpecError(
                f"live: got context {self.context_s} s, block {self.block_s} s, look-ahead "
                f"{self.look_ahead_ms} ms, delay {self.delay_frames}; expected up to 30 s, up to "
                "2 s, a time, and frames"
            )
