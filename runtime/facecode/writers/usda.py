"""A head for Blender, Omniverse, Unreal, Maya: USD as text (.usda), with UsdSkel blend shapes.

Comes in: a clip with faces, or several. Goes out: the units of the rig, or components of the
motion, and an animation of their weights. Text needs no library.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import BinaryIO

from facecode.clip import Clip
from facecode.writers.format import Format, gathered
from facecode.writers.shapes import shapes_of
from facecode.writers.usd.scene import scene


def write_usda(clip: Clip, file: BinaryIO, progress: bool = False) -> None:
    """Write a clip to an open binary file; too quick for `progress`.

    Raises:
        NoFacesError: the clip has no triangles.
    """
    write_takes_usda([clip], file, progress)


def write_takes_usda(clips: Sequence[Clip], file: BinaryIO, progress: bool = False) -> None:
    """Write faces side by side.

    Raises:
        NoFacesError: a clip has no triangles.
    """
    del progress
    file.write(scene(clips, ".usda", shapes_of(clips)).encode())


def write_blocks_usda(face: Clip, n_frames: int, blocks: Iterable[Clip], file: BinaryIO) -> None:
    """Write a clip that comes in blocks; with a rig only its weights are held.

    Raises:
        NoFacesError: the clip has no triangles.
    """
    del n_frames
    write_usda(gathered(face, blocks), file)


USDA = Format(
    ".usda", write_usda, write_takes_usda, write_blocks_usda, needs_faces=True, needs_vertices=False
)
