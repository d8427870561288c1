"""One output format a file; the suffix of the output picks the writer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, TypeAlias

from facecode.errors import OutputSuffixError
from facecode.writers.atomic import check_folder, writing
from facecode.writers.npz import write_npz

if TYPE_CHECKING:
    from facecode.animation import Animation

Writer: TypeAlias = "Callable[[Animation, BinaryIO], None]"
WRITERS: dict[str, Writer] = {".npz": write_npz}


def check_output(path: Path) -> None:
    """Refuse an output that cannot be written, before the work is done.

    Raises:
        OutputSuffixError: no writer for the suffix.
        OutputFolderError: the folder does not exist.
        OutputWriteError: the output is a folder.
    """
    if path.suffix.lower() not in WRITERS:
        raise OutputSuffixError(
            f"cannot write {path.name!r}: the suffix is {path.suffix!r}; expected one of "
            f"{', '.join(WRITERS)}"
        )
    check_folder(path)


def save(animation: Animation, path: Path) -> None:
    """Write `animation` in the format of the suffix, whole or not at all.

    Raises:
        OutputSuffixError, OutputFolderError, OutputWriteError.
    """
    check_output(path)
    with writing(path) as file:
        WRITERS[path.suffix.lower()](animation, file)
