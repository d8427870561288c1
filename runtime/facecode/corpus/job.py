"""What the workers of a batch share, and what goes to them and comes back."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from facecode import writers
from facecode.corpus.recording import Recording
from facecode.options import BatchOptions, Style
from facecode.session import Compute

PARQUET = "parquet"
FORMATS = (*(suffix[1:] for suffix in writers.FORMATS), PARQUET)

FILES_A_PORTION = 8
"""Recordings that a worker takes at a time: a batch of `animate_many`."""
ROWS_A_SHARD = 64
"""Recordings that a worker takes at a time where it writes them to one Parquet file."""


@dataclass(frozen=True)
class Job:
    """How all recordings are animated and where they go: plain values, for any process."""

    out: Path
    """The folder, which exists and which all workers see."""
    format: str
    """One of FORMATS."""
    bundle: str | None
    """As `facecode.load`."""
    compute: Compute
    """Of one worker."""
    style: Style | None
    """Of recordings that name none."""
    options: BatchOptions
    """Of all recordings."""
    offsets: bool
    """Whether rows of Parquet have offsets."""


@dataclass(frozen=True)
class Portion:
    """Recordings that one worker animates together.

    Portions depend on the corpus alone, so that results do not depend on who makes them.
    """

    number: int
    recordings: tuple[Recording, ...]


@dataclass(frozen=True)
class Failure:
    """A recording that could not be animated."""

    id: str
    error: str


@dataclass(frozen=True)
class Outcome:
    """What became of a portion."""

    number: int
    n: int
    """Recordings, with those that failed."""
    seconds: float
    """Of speech that was animated."""
    failures: tuple[Failure, ...]


def portions_of(recordings: list[Recording], output_format: str) -> list[Portion]:
    """All recordings in portions: files by size, rows in the order of the corpus."""
    n, ordered = ROWS_A_SHARD, recordings
    if output_format != PARQUET:
        n, ordered = FILES_A_PORTION, sorted(recordings, key=lambda r: (r.size, r.id))
    starts = range(0, len(ordered), n)
    return [Portion(i, tuple(ordered[start : start + n])) for i, start in enumerate(starts)]
