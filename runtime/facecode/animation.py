"""The result of animating a clip: motion, codes and rate, as a value."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from facecode import writers
from facecode.arrays import Audio, Codes, Colours, Faces, Offsets, Template
from facecode.errors import CodesError


@dataclass(frozen=True, eq=False)
class Animation:
    """A face in motion: T frames, V vertices, H codes a frame."""

    offsets: Offsets
    """(T, V, 3) float32, from the template, in the bundle's unit."""
    codes: Codes
    """(T, H) int64, rows of the motion codebook; several parts side by side."""
    fps: float
    template: Template
    """(V, 3) float32, the neutral face."""
    faces: Faces | None = None
    """(F, 3) int32 triangles, where the bundle knows its topology."""
    colours: Colours | None = None
    """(V, 3) uint8 RGB, where the bundle has colours."""
    audio: Audio | None = None
    """The speech, (n_samples,) float32 mono at `sample_rate`, for writers with sound."""
    sample_rate: int | None = None
    parts: Mapping[str, int] = field(default_factory=dict)
    """Codes a frame of each part of the face, in the order of their columns in `codes`."""

    def codes_of(self, part: str) -> Codes:
        """The codes (T, H) of one part.

        Raises:
            CodesError: no such part.
        """
        if part not in self.parts:
            raise CodesError(f"got part {part!r}; the parts are {', '.join(self.parts)}")
        names = list(self.parts)
        start = sum(self.parts[name] for name in names[: names.index(part)])
        return self.codes[:, start : start + self.parts[part]]

    @property
    def vertices(self) -> Offsets:
        """Positions (T, V, 3) float32: template plus offsets, a new array each time."""
        return self.offsets + self.template

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return len(self.codes) / self.fps

    def save(self, path: str | os.PathLike[str], *, progress: bool = False) -> None:
        """Write to `path`; the suffix picks the format (.npz, .mp4). Whole or not at all.

        Args:
            path: a file; what is there is replaced.
            progress: show a bar on stderr for formats that take their time.

        Raises:
            OutputSuffixError, OutputFolderError, OutputWriteError.
            NoFacesError: .mp4 of a clip without faces.
            MissingExtraError: .mp4 without the extra `video`.
        """
        writers.save(self, Path(path), progress)
