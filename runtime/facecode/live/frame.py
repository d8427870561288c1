"""One frame of a stream."""

from __future__ import annotations

from dataclasses import dataclass

from facecode.arrays import Codes, Float32, Offsets


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """The face at one moment of the speech."""

    index: int
    """0 for the first frame of the stream."""
    time_s: float
    """When the frame begins, in seconds of speech since the stream began."""
    codes: Codes
    """(H,) int64"""
    weights: Float32 | None
    """(K,) in [0, 1], of the stream's `weight_names`; None: the bundle has no face units."""
    offsets: Offsets | None
    """(V, 3) float32 from the neutral face, in the bundle's unit; None: not asked for."""

    def __repr__(self) -> str:
        held = [f"{len(self.codes)} codes"]
        held += [] if self.weights is None else [f"{len(self.weights)} weights"]
        held += [] if self.offsets is None else [f"{len(self.offsets):,} vertices"]
        return f"<LiveFrame {self.index} at {self.time_s:.3f} s: {', '.join(held)}>"
