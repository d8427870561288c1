"""Hidden frames of a part as `window` makes them final, row by row, for the vertex head."""

from __future__ import annotations

import numpy as np

from facecode.arrays import Codes, Float32


class ShownFrames:
    """Collects frames; what has been taken is let go."""

    def __init__(self) -> None:
        self._rows: dict[int, list[Float32]] = {}

    def __call__(self, rows: slice, hidden: Float32) -> None:
        """Add the hidden frames (rows, m, E) that follow for the rows `start` to `stop`."""
        for row, frames in zip(range(rows.start or 0, rows.stop), hidden, strict=True):
            self._rows.setdefault(row, []).append(frames)

    def __len__(self) -> int:
        """Frames of row 0 that wait to be taken."""
        return sum(len(frames) for frames in self._rows.get(0, ()))

    def has(self, row: int) -> bool:
        """Whether frames of `row` wait."""
        return row in self._rows

    def take(self, first: int, last: int) -> Float32:
        """All waiting frames (last - first, m, E) of the rows `first` to `last`."""
        return np.stack([np.concatenate(self._rows.pop(row)) for row in range(first, last)])

    def of_clip(self, clip: int, codes: Codes) -> Float32 | None:
        """Hidden frames (rows, T, E) of a clip with codes (rows, T, H), where there are any."""
        first, last = clip * len(codes), (clip + 1) * len(codes)
        return self.take(first, last) if self.has(first) else None
