"""A recording that is animated block by block: into a file, or into what a caller does with it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from facecode import writers
from facecode.animation import Animation


@dataclass(frozen=True, eq=False)
class Blocks:
    """Clips of the frames of one recording, one after the other; they can be taken once."""

    still: Animation
    """What is known of the face, without a frame."""
    n_frames: int
    """T, of all clips together."""
    clips: Iterator[Animation]

    def __repr__(self) -> str:
        return f"<Blocks: {self.still.summary(self.n_frames)}>"

    def __iter__(self) -> Iterator[Animation]:
        return self.clips

    @property
    def duration_s(self) -> float:
        """Length of all clips together in seconds."""
        return self.n_frames / self.still.fps

    def save(self, path: str | os.PathLike[str], *, progress: bool = False) -> None:
        """Write all to `path` as it comes; the suffix picks the format. Whole or not at all.

        Formats that need the whole clip gather it first.

        Raises:
            See `Animation.save`.
            TakenBlocksError: some of the clips have been taken before.
        """
        writers.save_blocks(self.still, self.n_frames, self.clips, Path(path), progress)
