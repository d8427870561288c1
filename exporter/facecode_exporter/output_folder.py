"""Folders that appear whole or not at all."""

from __future__ import annotations

import contextlib
import ctypes
import glob
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from facecode.errors import FacecodeError, OutputFolderError, OutputWriteError
from facecode_exporter.errors import OutputExistsError

YOUNG_S = 2.0
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2


@contextlib.contextmanager
def replacing(out: Path, ours: str) -> Iterator[Path]:
    """A new folder that takes the name `out` when the block ends well, and is removed if not.

    An existing `out` is replaced if it is empty or holds a file named `ours`; a link stays one, and
    what it leads to is replaced. What a killed process left is removed by the next one.

    Raises:
        OutputFolderError: the parent folder does not exist.
        OutputExistsError: `out` holds something else.
        OutputWriteError: no such folder can be made, or what is in it not be written.
    """
    out = Path(os.path.realpath(out))
    if not out.parent.is_dir():
        raise OutputFolderError(f"the folder {out.parent} does not exist; create it first")
    try:
        replaceable = out.is_dir() and ((out / ours).is_file() or not any(out.iterdir()))
        if out.exists() and not replaceable:
            raise OutputExistsError(f"{out} exists and holds no {ours}; name a new or empty folder")
        _sweep(out)
        with _claimed(out) as fresh:
            yield fresh
            fresh.chmod(0o777 & ~_umask())
            if out.exists():
                _exchange(fresh, out)
            else:
                fresh.rename(out)
    except OSError as error:
        if isinstance(error, FacecodeError):
            raise
        raise OutputWriteError(f"cannot write {out}: {error.strerror or error}") from error


@contextlib.contextmanager
def _claimed(out: Path) -> Iterator[Path]:
    """A new folder beside `out`, locked while this process lives, and gone at the end."""
    fresh = Path(tempfile.mkdtemp(prefix=f".{out.name}.", suffix=".part", dir=out.parent))
    try:
        handle = _lock(fresh)
        try:
            yield fresh
        finally:
            if handle is not None:
                os.close(handle)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _lock(folder: Path) -> int | None:
    """A handle that holds the folder until it is closed, as when a process ends, however it does.

    None: another process holds it, or the system has no such locks.
    """
    if sys.platform == "win32":
        return None
    import fcntl

    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        return None
    return handle


def _sweep(out: Path) -> None:
    """Remove folders that processes which were killed have left beside `out`."""
    for left in out.parent.glob(f".{glob.escape(out.name)}.*.part"):
        if time.time() - left.stat().st_mtime < YOUNG_S:  # perhaps not locked yet
            continue
        if (handle := _lock(left)) is not None:
            shutil.rmtree(left, ignore_errors=True)
            os.close(handle)


def _exchange(fresh: Path, out: Path) -> None:
    """Give `fresh` the name of `out` and the reverse, at once where the system can do that."""
    libc = ctypes.CDLL(None) if sys.platform == "linux" else None
    if libc is not None and hasattr(libc, "renameat2"):
        names = (os.fsencode(fresh), os.fsencode(out))
        if libc.renameat2(_AT_FDCWD, names[0], _AT_FDCWD, names[1], _RENAME_EXCHANGE) == 0:
            return
    old = Path(tempfile.mkdtemp(prefix=f".{out.name}.", suffix=".part", dir=out.parent))
    out.rename(old / out.name)
    fresh.rename(out)
    shutil.rmtree(old)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
