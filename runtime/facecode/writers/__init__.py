"""Output files: the suffix picks one of FORMATS, and a file appears whole or not at all.

A new format is a new file in this folder and its line in FORMATS.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from facecode.clip import Clip
from facecode.errors import (
    NoFacesError,
    NoRigError,
    NoVerticesError,
    OutputSuffixError,
    TakenBlocksError,
)
from facecode.writers.audio2face_json import JSON
from facecode.writers.files import check_folder, writing
from facecode.writers.format import Format
from facecode.writers.glb import GLB
from facecode.writers.html import HTML
from facecode.writers.live_link_csv import CSV
from facecode.writers.mp4 import MP4
from facecode.writers.npz import NPZ
from facecode.writers.point_cache import MDD, PC2
from facecode.writers.usda import USDA
from facecode.writers.usdc import USDC
from facecode.writers.usdz import USDZ
from facecode.writers.vrma import VRMA

__all__ = [
    "FORMATS",
    "check_face",
    "check_folder",
    "check_format",
    "check_output",
    "format_of",
    "save",
    "save_blocks",
    "write",
    "writing",
]

FORMATS: dict[str, Format] = {
    f.suffix: f for f in (NPZ, MP4, GLB, HTML, CSV, JSON, USDA, USDZ, USDC, VRMA, PC2, MDD)
}
"""By suffix, in the order in which they are shown to users."""


def format_of(path: Path) -> Format:
    """The format that the suffix of `path` names.

    Raises:
        OutputSuffixError
    """
    try:
        return FORMATS[path.suffix.lower()]
    except KeyError:
        raise OutputSuffixError(
            f"cannot write {path.name!r}: the suffix is {path.suffix!r}; expected one of "
            f"{', '.join(FORMATS)}"
        ) from None


def check_output(path: Path) -> None:
    """Refuse an output that cannot be written, before the work is done.

    Raises:
        OutputSuffixError: no format with that suffix.
        OutputFolderError: the folder does not exist.
        OutputWriteError: the output is a folder.
        MissingExtraError: the format needs a package that is not installed.
    """
    check_format(path)
    check_folder(path)


def check_format(path: Path) -> None:
    """Refuse a suffix that no format has, or one whose package is missing.

    Raises:
        OutputSuffixError, MissingExtraError.
    """
    found = format_of(path)
    if found.check is not None:
        found.check()


def check_face(found: Format, has_faces: bool, has_rig: bool, n_faces: int = 1) -> None:
    """Refuse a format that cannot hold what there is, before the work is done.

    Args:
        found: the format.
        has_faces: whether the triangles are known.
        has_rig: whether the face units are known.
        n_faces: how many faces of one recording go into the file.

    Raises:
        NoFacesError, NoRigError.
        OutputSuffixError: the format holds one face, and there are several.
    """
    if found.needs_faces and not has_faces:
        raise NoFacesError.to_write(found.suffix)
    if found.needs_rig and not has_rig:
        raise NoRigError.to_write(found.suffix)
    if n_faces > 1 and found.write_takes is None:
        several = [f.suffix for f in FORMATS.values() if f.write_takes is not None]
        raise OutputSuffixError(
            f"{found.suffix} holds one face, and there are {n_faces}; expected one of "
            f"{', '.join(several)}, or ask for one sample"
        )


def save(
    clips: Clip | Sequence[Clip], path: Path, progress: bool = False, found: Format | None = None
) -> None:
    """Write one face, or several of one recording; whole or not at all.

    Args:
        clips: one face, or several of one rate and length.
        path: the file.
        progress: show a bar on stderr for formats that take their time.
        found: the format; by default that of the suffix.

    Raises:
        OutputSuffixError, OutputFolderError, OutputWriteError, NoFacesError, NoRigError,
        MissingExtraError.
    """
    check_output(path)
    with writing(path) as file:
        write(clips, file, found or format_of(path), progress)


def save_blocks(
    face: Clip,
    n_frames: int,
    blocks: Iterable[Clip],
    path: Path,
    progress: bool = False,
    found: Format | None = None,
) -> None:
    """Write one face as its frames come, block by block; whole or not at all.

    Args:
        face: what is known of it, with no frame.
        n_frames: of all blocks together.
        blocks: clips of consecutive frames.
        path: the file; a format that needs the whole clip gathers it first.
        progress: show a bar on stderr for formats that take their time.
        found: the format; by default that of the suffix.

    Raises:
        As `save`.
        TakenBlocksError: another number of frames.
    """
    check_output(path)
    found = found or format_of(path)
    check_face(found, face.faces is not None, face.rig is not None)
    checked = _counted((_fitting(block, found) for block in blocks), n_frames)
    with writing(path) as file:
        if found.write_blocks is None:
            write(_whole(face, checked), file, found, progress)
        else:
            found.write_blocks(face, n_frames, checked, file)


def _counted(blocks: Iterable[Clip], n_frames: int) -> Iterator[Clip]:
    """The blocks; TakenBlocksError at their end if they have another number of frames."""
    n = 0
    for block in blocks:
        n += block.n_frames
        yield block
    if n != n_frames:
        raise TakenBlocksError(
            f"got {n} of {n_frames} frames to write; blocks can be taken once: ask for them anew"
        )


def _whole(face: Clip, blocks: Iterable[Clip]) -> Clip:
    parts = list(blocks)
    return dataclasses.replace(
        face,
        offsets=np.concatenate([face.offsets, *(part.offsets for part in parts)]),
        codes=np.concatenate([face.codes, *(part.codes for part in parts)]),
    )


def _fitting(clip: Clip, found: Format) -> Clip:
    """The clip; NoVerticesError if it has weights alone and the format holds vertices."""
    has_vertices = clip.offsets.shape[1] == len(clip.template)
    if not has_vertices and (found.needs_vertices or clip.rig is None):
        raise NoVerticesError.to_give(found.suffix)
    return clip


def write(
    clips: Clip | Sequence[Clip], file: BinaryIO, found: Format, progress: bool = False
) -> None:
    """Write one face, or several of one recording, to an open file that can seek.

    Raises:
        OutputSuffixError, NoFacesError, NoRigError, NoVerticesError.
    """
    first, n_faces = (clips, 1) if isinstance(clips, Clip) else (clips[0], len(clips))
    _fitting(first, found)
    check_face(found, first.faces is not None, first.rig is not None, n_faces)
    if isinstance(clips, Clip) or found.write_takes is None:
        found.write(first, file, progress)
    else:
        found.write_takes(clips, file, progress)
