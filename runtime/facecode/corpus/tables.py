"""Parquet files as a source: a column of audio, as bytes or paths, with columns that describe it.

The only module of the sources that needs pyarrow.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from facecode.corpus.recording import Recording, Row
from facecode.errors import CorpusError, MissingExtraError

AUDIO = "audio"
DESCRIBING = ("id", "style", "template")


def parquet() -> ModuleType:
    """pyarrow.parquet.

    Raises:
        MissingExtraError
    """
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise MissingExtraError.of("Parquet", "pyarrow", "batch") from error
    return pyarrow.parquet  # type: ignore[no-any-return]


def recordings_of(path: Path) -> Iterator[Recording]:
    """Recordings of one Parquet file; no audio is read.

    Raises:
        CorpusError: not Parquet, or without a column `audio`.
        MissingExtraError
    """
    pq = parquet()
    try:
        file = pq.ParquetFile(path)
    except (OSError, ValueError) as error:
        raise CorpusError(f"{path} is not a Parquet file: {error}") from error
    with file:
        names = file.schema_arrow.names
        if AUDIO not in names:
            raise CorpusError(
                f"{path} has the columns {', '.join(names)}; expected one named {AUDIO!r} with the "
                "bytes of audio files, or paths"
            )
        columns = [name for name in DESCRIBING if name in names]
        number = 0
        for group in range(file.num_row_groups):
            n_rows = file.metadata.row_group(group).num_rows
            described = file.read_row_group(group, columns=columns).to_pylist() if columns else []
            for row in range(n_rows):
                known = described[row] if described else {}
                known = {name: str(value) for name, value in known.items() if value is not None}
                known.setdefault("id", f"{path.stem}-{number:06d}")
                yield Recording(path=path, place=Row(group, row, AUDIO), **known)
                number += 1


def read_column(path: Path, group: int, column: str) -> list[Any]:
    """The values of a column in a row group.

    Raises:
        MissingExtraError, OSError
    """
    with parquet().ParquetFile(path) as file:
        return file.read_row_group(group, columns=[column])[column].to_pylist()  # type: ignore[no-any-return]
