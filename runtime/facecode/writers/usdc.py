"""Exact vertices in USD's binary format (.usdc): a mesh whose points have a sample a frame.

Comes in: a clip with faces, or several. The format is a labyrinth, so usd-core (extra `usd`)
writes it: the text of the scene at rest, then the points of each frame.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from facecode.clip import Clip
from facecode.errors import MissingExtraError, OutputWriteError
from facecode.wording import one_line
from facecode.writers.format import Format
from facecode.writers.space import metres_y_up
from facecode.writers.usd.scene import head_names, mesh_path, scene


def check_usdc() -> None:
    """Refuse to begin without the library that writes.

    Raises:
        MissingExtraError
    """
    _pxr()


def write_usdc(clip: Clip, file: BinaryIO, progress: bool = False) -> None:
    """Write a clip to an open binary file.

    Raises:
        NoFacesError: the clip has no triangles.
        MissingExtraError: usd-core is not installed.
    """
    write_takes_usdc([clip], file, progress)


def write_takes_usdc(clips: Sequence[Clip], file: BinaryIO, progress: bool = False) -> None:
    """Write faces side by side.

    Raises:
        NoFacesError: a clip has no triangles.
        MissingExtraError: usd-core is not installed.
    """
    del progress
    sdf, vt = _pxr()
    layer = sdf.Layer.CreateAnonymous(".usdc")
    layer.ImportFromString(scene(clips, ".usdc", None))
    for name, clip in zip(head_names(len(clips)), clips, strict=True):
        mesh = mesh_path(name)
        for frame, offsets in enumerate(clip.offsets):
            points = metres_y_up(clip, offsets + clip.template)
            bounds = np.stack([points.min(axis=0), points.max(axis=0)])
            for attribute, value in (("points", points), ("extent", bounds)):
                samples = vt.Vec3fArray.FromNumpy(np.ascontiguousarray(value))
                layer.SetTimeSample(f"{mesh}.{attribute}", frame, samples)
    with tempfile.TemporaryDirectory(prefix="facecode-") as folder:
        path = Path(folder) / "clip.usdc"
        try:
            layer.Export(str(path))
        except RuntimeError as error:  # how USD says that a disk is full
            raise OutputWriteError(f"cannot write {path.name}: {one_line(error)}") from error
        with path.open("rb") as written:
            while block := written.read(1 << 20):
                file.write(block)


def _pxr() -> tuple[Any, Any]:
    try:
        from pxr import Sdf, Vt
    except ImportError as error:
        raise MissingExtraError.of(
            "writing .usdc", "usd-core (Python 3.11 or later)", "usd"
        ) from error
    return Sdf, Vt


USDC = Format(".usdc", write_usdc, write_takes_usdc, needs_faces=True, check=check_usdc)
