"""Graphs as a manifest states them, which may not be those of the parts that it states."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from facecode.errors import FacecodeError, ManifestError
from facecode.wording import one_line


@contextlib.contextmanager
def stated_graphs(root: Path) -> Iterator[None]:
    """What goes wrong while sizes are read from signatures is the manifest's: a ManifestError."""
    try:
        yield
    except FacecodeError:
        raise
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise ManifestError(
            f"the graphs that the manifest of {root} states are not those of such parts "
            f"({one_line(error)}); export it again"
        ) from error
