"""Files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from facecode.errors import OutputFolderError, OutputWriteError


def check_folder(path: Path) -> None:
    """Refuse a file name whose folder is missing, or that is a folder itself.

    Raises:
        OutputFolderError, OutputWriteError.
    """
    if not path.parent.is_dir():
        raise OutputFolderError(f"the folder {path.parent} does not exist; create it first")
    if path.is_dir():
        raise OutputWriteError(f"{path} is a folder; name a file")


@contextlib.contextmanager
def writing(path: Path) -> Iterator[BinaryIO]:
    """An open file beside `path` that takes its name when the block ends well.

    A full disk or an interrupt leaves `path` as it was and nothing beside it.

    Raises:
        OutputFolderError, OutputWriteError.
    """
    check_folder(path)
    temporary = None
    try:
        handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        with os.fdopen(handle, "wb") as file:
            yield file
        Path(temporary).chmod(0o666 & ~_umask())  # mkstemp makes files private
        Path(temporary).replace(path)
    except OSError as error:
        raise OutputWriteError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
