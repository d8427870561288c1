"""Exact vertices in USD's binary format (.usdc): a mesh whose points have a sample a frame.

Comes in: a clip with faces, or several. The format is a labyrinth, so usd-core (extra `usd`)
writes it: the text of the scene at rest, then the points of each frame.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from facecode.arrays import Float32
from facecode.clip import Clip
from facecode.errors import MissingExtraError, OutputWriteError
from facecode.wording import one_line
from facecode.writers.format import Format
from facecode.writers.space import metres_y_up
from facecode.writers.usd.scene import head_names, mesh_path, scene

SAVED_EVERY = 256
"""Frames: so many are held in memory."""


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
    _write(clips, clips[0].n_frames, zip(*(clip.offsets for clip in clips), strict=True), file)


def write_blocks_usdc(face: Clip, n_frames: int, blocks: Iterable[Clip], file: BinaryIO) -> None:
    """Write a clip that comes in blocks; a few hundred frames are held.

    Raises:
        NoFacesError: the clip has no triangles.
        MissingExtraError: usd-core is not installed.
    """
    _write([face], n_frames, ((offsets,) for block in blocks for offsets in block.offsets), file)


def _write(
    clips: Sequence[Clip], n_frames: int, frames: Iterable[Sequence[Float32]], file: BinaryIO
) -> None:
    """Write faces at rest, then of each frame the offsets (V, 3) of every face."""
    sdf, vt = _pxr()
    at_rest = sdf.Layer.CreateAnonymous(".usda")
    at_rest.ImportFromString(scene(clips, ".usdc", None))
    meshes = [mesh_path(name) for name in head_names(len(clips))]
    with tempfile.TemporaryDirectory(prefix="facecode-") as folder:
        path = Path(folder) / "clip.usdc"
        try:
            at_rest.Export(str(path))
            layer = sdf.Layer.FindOrOpen(str(path))  # what is saved is no longer in memory
            layer.endTimeCode = max(n_frames - 1, 0)
            for frame, offsets in enumerate(frames):
                for mesh, clip, moved in zip(meshes, clips, offsets, strict=True):
                    points = metres_y_up(clip, moved + clip.template)
                    bounds = np.stack([points.min(axis=0), points.max(axis=0)])
                    for attribute, value in (("points", points), ("extent", bounds)):
                        samples = vt.Vec3fArray.FromNumpy(np.ascontiguousarray(value))
                        layer.SetTimeSample(f"{mesh}.{attribute}", frame, samples)
                if frame % SAVED_EVERY == SAVED_EVERY - 1:
                    layer.Save()
            layer.Save()
            del layer
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


USDC = Format(
    ".usdc", write_usdc, write_takes_usdc, write_blocks_usdc, needs_faces=True, check=check_usdc
)
