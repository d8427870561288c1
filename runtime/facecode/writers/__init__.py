"""One output format a file; the suffix of the output picks the writer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, TypeAlias

from facecode.arrays import Faces
from facecode.errors import NoFacesError, OutputSuffixError
from facecode.writers.atomic import check_folder, writing
from facecode.writers.mp4 import check_mp4, write_mp4
from facecode.writers.npz import write_npz, write_takes_npz

if TYPE_CHECKING:
    from facecode.animation import Animation
    from facecode.takes import Takes

Writer: TypeAlias = "Callable[[Animation, BinaryIO, bool], None]"
"""(animation, an open file, whether to show progress on stderr)"""
WRITERS: dict[str, Writer] = {".npz": write_npz, ".mp4": write_mp4}
TAKES_WRITERS: dict[str, Callable[[Takes, BinaryIO, bool], None]] = {".npz": write_takes_npz}
"""The same for several faces of one recording."""
CHECKS: dict[str, Callable[[], None]] = {".mp4": check_mp4}
"""What a format needs that may not be installed."""
NEED_FACES = frozenset({".mp4"})


def check_output(path: Path) -> None:
    """Refuse an output that cannot be written, before the work is done.

    Raises:
        OutputSuffixError: no writer for the suffix.
        OutputFolderError: the folder does not exist.
        OutputWriteError: the output is a folder.
        MissingExtraError: the format needs a package that is not installed.
    """
    if path.suffix.lower() not in WRITERS:
        raise OutputSuffixError(
            f"cannot write {path.name!r}: the suffix is {path.suffix!r}; expected one of "
            f"{', '.join(WRITERS)}"
        )
    check_folder(path)
    CHECKS.get(path.suffix.lower(), lambda: None)()


def check_faces(path: Path, faces: Faces | None) -> None:
    """Refuse a format that shows a surface for a face without one, before the work is done.

    Raises:
        NoFacesError
    """
    suffix = path.suffix.lower()
    if faces is None and suffix in NEED_FACES:
        raise NoFacesError.to_write(suffix)


def save_takes(takes: Takes, path: Path, progress: bool = False) -> None:
    """Write all clips of `takes` to one file, whole or not at all.

    Raises:
        OutputSuffixError, OutputFolderError, OutputWriteError, NoFacesError, MissingExtraError.
    """
    check_output(path)
    check_faces(path, takes[0].faces)
    with writing(path) as file:
        TAKES_WRITERS[path.suffix.lower()](takes, file, progress)


def save(animation: Animation, path: Path, progress: bool = False) -> None:
    """Write `animation` in the format of the suffix, whole or not at all.

    Raises:
        OutputSuffixError, OutputFolderError, OutputWriteError, NoFacesError, MissingExtraError.
    """
    check_output(path)
    check_faces(path, animation.faces)
    with writing(path) as file:
        WRITERS[path.suffix.lower()](animation, file, progress)
