"""The audio of recordings, wherever it lies."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

from facecode.audio import AudioSource
from facecode.corpus.recording import Recording, Row
from facecode.corpus.tables import read_column
from facecode.errors import AudioNotFoundError, UnreadableAudioError


class Reader:
    """Gives the audio of recordings; keeps one row group of Parquet, since rows come in turn."""

    def __init__(self) -> None:
        self._held: tuple[tuple[Path, int, str], list[Any]] | None = None

    def audio(self, recording: Recording) -> AudioSource:
        """A path, or an open binary file.

        Raises:
            AudioNotFoundError, UnreadableAudioError
        """
        if recording.place is None:
            return recording.path
        try:
            if isinstance(recording.place, Row):
                return self._in_table(recording.path, recording.place)
            with recording.path.open("rb") as file:
                file.seek(recording.place)
                return io.BytesIO(file.read(recording.size))
        except FileNotFoundError as error:
            raise AudioNotFoundError(f"{recording.path} does not exist any more") from error
        except OSError as error:
            raise UnreadableAudioError(f"cannot read {recording.path}: {error}") from error

    def _in_table(self, path: Path, place: Row) -> AudioSource:
        wanted = (path, place.group, place.column)
        if self._held is None or self._held[0] != wanted:
            self._held = (wanted, read_column(path, place.group, place.column))
        value = self._held[1][place.row]
        if isinstance(value, dict):
            value = value.get("path") if value.get("bytes") is None else value["bytes"]
        if isinstance(value, bytes):
            return io.BytesIO(value)
        if isinstance(value, str):
            return path.parent / value
        raise UnreadableAudioError(
            f"{path} has {type(value).__name__} in the column {place.column!r}; expected the bytes "
            "of an audio file, a path, or both as {bytes, path}"
        )
