"""The result of animating a recording: a clip that can save itself."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from facecode import writers
from facecode.clip import Clip


@dataclass(frozen=True, eq=False)
class Animation(Clip):
    """A face in motion: T frames, V vertices, H codes a frame; see `Clip` for its arrays."""

    def save(self, path: str | os.PathLike[str], *, progress: bool = False) -> None:
        """Write to `path`; the suffix picks the format. Whole or not at all.

        Args:
            path: a file; what is there is replaced.
            progress: show a bar on stderr for formats that take their time.

        Raises:
            OutputSuffixError, OutputFolderError, OutputWriteError.
            NoFacesError: a format that shows a surface, of a clip without triangles.
            NoRigError: a format of weights, of a clip without face units.
            MissingExtraError: the format needs a package that is not installed.
        """
        writers.save(self, Path(path), progress)
