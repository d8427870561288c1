"""The result of animating a recording: a clip that can save itself."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from facecode import writers
from facecode.bundle import Bundle
from facecode.clip import Clip


@dataclass(frozen=True, eq=False, repr=False)
class Animation(Clip):
    """A face in motion: T frames, V vertices, H codes a frame; see `Clip` for its arrays."""

    @classmethod
    def still(cls, bundle: Bundle) -> Animation:
        """No frame, with all that a bundle knows of its face."""
        m = bundle.manifest
        widths = {part.name: part.codes_per_frame for part in m.parts}
        return cls(
            offsets=np.empty((0, m.n_vertices, 3), np.float32),
            codes=np.empty((0, sum(widths.values())), np.int64),
            fps=m.fps,
            template=bundle.template,
            faces=bundle.faces,
            colours=bundle.colours,
            sample_rate=m.sample_rate,
            parts=widths,
            unit=m.unit,
            metres_per_unit=m.metres_per_unit,
            up_axis=m.up_axis,
            lip_pair=bundle.lip_pair,
            rig=bundle.rig,
        )

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
