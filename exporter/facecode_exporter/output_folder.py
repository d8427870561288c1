"""Folders that appear whole or not at all."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from facecode.errors import OutputFolderError
from facecode_exporter.errors import OutputExistsError


@contextlib.contextmanager
def replacing(out: Path, ours: str) -> Iterator[Path]:
    """A new folder that takes the name `out` when the block ends well, and is removed if not.

    An existing `out` is replaced if it is empty or holds a file named `ours`.

    Raises:
        OutputFolderError: the parent folder does not exist.
        OutputExistsError: `out` holds something else.
    """
    out = out.absolute()
    if not out.parent.is_dir():
        raise OutputFolderError(f"the folder {out.parent} does not exist; create it first")
    replaceable = out.is_dir() and ((out / ours).is_file() or not any(out.iterdir()))
    if out.exists() and not replaceable:
        raise OutputExistsError(f"{out} exists and holds no {ours}; name a new or empty folder")
    fresh = Path(tempfile.mkdtemp(prefix=f".{out.name}.", dir=out.parent))
    try:
        yield fresh
        fresh.chmod(0o755)
        if out.exists():
            old = Path(tempfile.mkdtemp(prefix=f".{out.name}.old.", dir=out.parent))
            out.rename(old / out.name)
            fresh.rename(out)
            shutil.rmtree(old)
        else:
            fresh.rename(out)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
