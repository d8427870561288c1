"""One output format a file; the suffix of the output picks the writer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, TypeAlias

from facecode.arrays import Faces
from facecode.errors import NoFacesError, OutputSuffixError
from facecode.writers.atomic import check_folder, writing
from facecode.writers.mp4 import check_mp4, write_mp4, write_side_by_side
from facecode.writers.npz import write_npz, write_takes_npz

if TYPE_CHECKING:
    from facecode.animation import Animation
    from facecode.takes import Takes

Writer: TypeAlias = "Callable[[Animation, BinaryIO, bool], None]"
"""(animation, an open file, whether to show progress on stderr)"""
WRITERS: dict[str, Writer] = {".npz": write_npz, ".mp4": write_mp4}
TAKES_WRITERS: dict[str, Callable[[Takes, BinaryIO, bool], None]] = {
    ".npz": write_takes_npz,
    ".mp4": lambda takes, file, progress: write_side_by_side(takes.clips, file, progress),
}
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


def save(moved: Animation | Takes, path: Path, progress: bool = False) -> None:
    """Write one face or several in the format of the suffix, whole or not at all.

    Raises:
        OutputSuffixError, OutputFolderError, OutputWriteError, NoFacesError, MissingExtraError.
    """
    check_output(path)
    check_faces(path, moved.faces)
    with writing(path) as file:
        write(moved, file, path.suffix, progress)


def write(moved: Animation | Takes, file: BinaryIO, suffix: str, progress: bool = False) -> None:
    """Write one face or several to an open file."""
    from facecode.takes import Takes

    if isinstance(moved, Takes):
        TAKES_WRITERS[suffix.lower()](moved, file, progress)
    else:
        WRITERS[suffix.lower()](moved, file, progress)
