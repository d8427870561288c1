"""One output format a file; the suffix of the output picks the writer.

Every writer fills a temporary file beside the output that is renamed when it is complete, so that
a full disk or an interrupt leaves nothing half-written.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, TypeAlias

from facecode.errors import OutputFolderError, OutputSuffixError, OutputWriteError
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
    if not path.parent.is_dir():
        raise OutputFolderError(f"the folder {path.parent} does not exist; create it first")
    if path.is_dir():
        raise OutputWriteError(f"{path} is a folder; name a file")


def save(animation: Animation, path: Path) -> None:
    """Write `animation` in the format of the suffix, whole or not at all.

    Raises:
        OutputSuffixError, OutputFolderError, OutputWriteError.
    """
    check_output(path)
    writer = WRITERS[path.suffix.lower()]
    temporary = None
    try:
        handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        with os.fdopen(handle, "wb") as file:
            writer(animation, file)
        os.chmod(temporary, 0o666 & ~_umask())  # noqa: PTH101  # mkstemp makes private files
        os.replace(temporary, path)  # noqa: PTH105
    except OSError as error:
        raise OutputWriteError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        if temporary is not None:
            with contextlib.suppress(FileNotFoundError):
                os.unlink(temporary)  # noqa: PTH108


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
