"""One recording of a corpus: what it is called, where its audio lies, how it is to be animated."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple


class Row(NamedTuple):
    """Where a row of a Parquet file lies."""

    group: int
    """The row group."""
    row: int
    """In the group."""
    column: str
    """The column of the audio."""


@dataclass(frozen=True)
class Recording:
    """A recording that has not been read; small, so that a million of them fit."""

    id: str
    """Its name among all, and of its file: a relative path without suffix."""
    path: Path
    """The audio, or the file that holds it."""
    size: int = 0
    """Bytes of audio, by which recordings of about one length are packed; 0: not known."""
    style: str | None = None
    """As `--style`; None: that of the batch."""
    template: str | None = None
    """As `--template`; None: that of the batch."""
    place: int | Row | None = None
    """In a tar file its first byte, in a Parquet file its row; None: the whole file."""
