"""Output files appear whole or not at all, where their name leads."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from facecode.errors import OutputFolderError, OutputWriteError


def check_folder(path: Path) -> None:
    """Refuse a file name whose folder is missing or cannot be written, or that is a folder itself.

    Raises:
        OutputFolderError, OutputWriteError.
    """
    folder = _target(path).parent
    if not folder.is_dir():
        raise OutputFolderError(f"the folder {folder} does not exist; create it first")
    if path.is_dir():
        raise OutputWriteError(f"{path} is a folder; name a file")
    if not _is_special(path) and not os.access(folder, os.W_OK | os.X_OK):
        raise OutputWriteError(f"the folder {folder} cannot be written; name another")


@contextlib.contextmanager
def writing(path: Path) -> Iterator[BinaryIO]:
    """An open file beside `path` that takes its name when the block ends well.

    A full disk or an interrupt leaves `path` as it was and nothing beside it. A link stays one, and
    what it leads to is written; pipes and devices get the bytes when all of them are there.

    Raises:
        OutputFolderError, OutputWriteError.
    """
    check_folder(path)
    try:
        with _passing_on(path) if _is_special(path) else _replacing(_target(path)) as file:
            yield file
    except OSError as error:
        raise OutputWriteError(f"cannot write {path}: {error.strerror or error}") from error


@contextlib.contextmanager
def _replacing(target: Path) -> Iterator[BinaryIO]:
    handle = _nameless(target.parent)
    if handle is None:
        with _named(target) as file:
            yield file
        return
    with os.fdopen(handle, "wb") as file:
        yield file
        file.flush()
        try:
            _name(file, target)
        except FileExistsError:
            beside = target.parent / f".facecode-{secrets.token_hex(8)}"
            _name(file, beside)
            try:
                beside.replace(target)
            finally:
                beside.unlink(missing_ok=True)


def _nameless(folder: Path) -> int | None:
    """A file in `folder` that a killed process leaves nothing of; None: the system has no such."""
    flag = getattr(os, "O_TMPFILE", None)
    if flag is None or not Path("/proc/self/fd").is_dir():
        return None
    try:
        return os.open(folder, flag | os.O_RDWR, 0o666)
    except OSError as error:
        if error.errno in (errno.EOPNOTSUPP, errno.EISDIR, errno.ENOENT, errno.EINVAL):
            return None
        raise


def _name(file: BinaryIO, name: Path) -> None:
    folder = os.open(name.parent, os.O_RDONLY)
    try:  # with a folder given, Python follows the link of /proc
        os.link(f"/proc/self/fd/{file.fileno()}", name.absolute(), src_dir_fd=folder)
    finally:
        os.close(folder)


@contextlib.contextmanager
def _named(target: Path) -> Iterator[BinaryIO]:
    """A file under another name first, on systems without nameless ones."""
    handle, temporary = tempfile.mkstemp(prefix=".facecode-", dir=target.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
        Path(temporary).chmod(0o666 & ~_umask())  # mkstemp makes files private
        Path(temporary).replace(target)
    finally:
        Path(temporary).unlink(missing_ok=True)


@contextlib.contextmanager
def _passing_on(path: Path) -> Iterator[BinaryIO]:
    """A pipe cannot seek, and writers do."""
    with tempfile.TemporaryFile() as file:
        yield file
        file.seek(0)
        with path.open("wb") as target:
            shutil.copyfileobj(file, target)


def _is_special(path: Path) -> bool:
    return path.exists() and not path.is_file() and not path.is_dir()


def _target(path: Path) -> Path:
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
