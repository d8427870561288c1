"""What a corpus consists of: a folder, a list, Parquet files, or shards of tar files."""

from __future__ import annotations

import csv
import json
import os
import tarfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath

from facecode.corpus import tables
from facecode.corpus.recording import Recording
from facecode.errors import CorpusError, CorpusNotFoundError

AUDIO_SUFFIXES = {".wav", ".flac", ".ogg", ".opus", ".mp3", ".aif", ".aiff", ".au", ".caf", ".w64"}
"""What is a recording in a folder or a tar file; a list may name any."""


def recordings_in(source: str | os.PathLike[str]) -> list[Recording]:
    """The recordings of a corpus, in the order of its files or lists; no audio is read.

    Args:
        source: a folder of audio, of Parquet files or of tar files; a .txt with a path a line; a
            .csv or .jsonl with `audio` and, if need be, `id`, `style` and `template`; a .parquet
            with a column `audio`; a .tar of the WebDataset form. Paths in a list begin at its
            folder.

    Raises:
        CorpusNotFoundError: nothing at that path.
        CorpusError: cannot be read, holds no recording, or two of one name.
        MissingExtraError: Parquet without pyarrow.
    """
    root = Path(source)
    if not root.exists():
        raise CorpusNotFoundError(f"no folder or file at {root}")
    try:
        found = list(_in_folder(root) if root.is_dir() else _in_file(root))
    except UnicodeDecodeError as error:
        raise CorpusError(f"{root} is not UTF-8 text: {error}") from error
    except OSError as error:
        raise CorpusError(f"cannot read {root}: {error}") from error
    if not found:
        raise CorpusError(
            f"no recording in {root}; expected files such as {', '.join(sorted(AUDIO_SUFFIXES))}"
        )
    _check_names(found)
    return found


def _in_folder(folder: Path) -> Iterator[Recording]:
    files = sorted(path for path in folder.rglob("[!.]*") if path.is_file())
    if audio := [path for path in files if path.suffix.lower() in AUDIO_SUFFIXES]:
        for path in audio:
            name = path.relative_to(folder).with_suffix("").as_posix()
            yield Recording(name, path, path.stat().st_size)
        return
    for path in files:
        if path.suffix.lower() in (".parquet", ".tar"):
            yield from _in_file(path)


def _in_file(path: Path) -> Iterator[Recording]:
    readers: dict[str, Callable[[Path], Iterable[Recording]]] = {
        ".txt": _in_lines,
        ".csv": _in_csv,
        ".jsonl": _in_json_lines,
        ".parquet": tables.recordings_of,
        ".tar": _in_tar,
    }
    if path.suffix.lower() not in readers:
        raise CorpusError(
            f"got {path.name!r} as a corpus; expected a folder, or one of {', '.join(readers)}. "
            "One recording is for facecode animate"
        )
    return iter(readers[path.suffix.lower()](path))


def _in_lines(path: Path) -> Iterator[Recording]:
    for line in path.read_text(encoding="utf-8-sig").splitlines():
        if line.strip():
            yield _listed(path, {"audio": line.strip()})


def _in_csv(path: Path) -> Iterator[Recording]:
    with path.open(encoding="utf-8-sig", newline="") as file:
        for entry in csv.DictReader(file):
            yield _listed(path, entry)


def _in_json_lines(path: Path) -> Iterator[Recording]:
    for number, line in enumerate(path.read_text(encoding="utf-8-sig").splitlines(), 1):
        if not line.strip():
            continue
        try:
            entry = json.loads(line)
        except ValueError as error:
            raise CorpusError(f"line {number} of {path} is not JSON: {error}") from error
        yield _listed(path, entry)


def _listed(path: Path, entry: object) -> Recording:
    """The recording of an entry; empty values are as if they were not there."""
    known = entry if isinstance(entry, Mapping) else {}
    texts = {key: str(value) for key, value in known.items() if key and value not in (None, "")}
    if "audio" not in texts:
        raise CorpusError(f"an entry of {path} has no `audio`: {entry}; give each a path")
    audio = path.parent / texts["audio"]
    name = PurePosixPath(Path(texts["audio"]).with_suffix("").as_posix())
    inside = not name.is_absolute() and ".." not in name.parts
    template = texts.get("template")
    if template is not None and (path.parent / template).is_file():
        template = str(path.parent / template)
    return Recording(
        id=texts.get("id", str(name) if inside else name.name),
        path=audio,
        size=audio.stat().st_size if audio.is_file() else 0,
        style=texts.get("style"),
        template=template,
    )


def _in_tar(path: Path) -> Iterator[Recording]:
    """Members by their key, up to the first dot: audio, and a .json with style and template."""
    audio: dict[str, tarfile.TarInfo] = {}
    described: dict[str, Mapping[str, object]] = {}
    try:
        with tarfile.open(path, "r:") as tar:
            for member in tar:
                folder, _, name = member.name.rpartition("/")
                if name.startswith("."):  # what macOS leaves beside each file
                    continue
                key, _, suffix = name.partition(".")
                key = f"{folder}/{key}" if folder else key
                if member.isfile() and f".{suffix.lower()}" in AUDIO_SUFFIXES:
                    audio[key.removeprefix("./")] = member
                elif suffix == "json" and (file := tar.extractfile(member)) is not None:
                    described[key.removeprefix("./")] = json.load(file)
    except (tarfile.TarError, ValueError) as error:
        raise CorpusError(
            f"cannot read {path} as an uncompressed tar file: {error}; unpack a compressed one"
        ) from error
    for key, member in audio.items():
        entry = described.get(key, {})
        style, template = (
            entry.get(n) if isinstance(entry, dict) else None for n in ("style", "template")
        )
        yield Recording(
            id=key,
            path=path,
            size=member.size,
            style=None if style is None else str(style),
            template=None if template is None else str(template),
            place=member.offset_data,
        )


def _check_names(recordings: list[Recording]) -> None:
    """Refuse names that would leave the output folder, or stand for two recordings."""
    seen: set[str] = set()
    for recording in recordings:
        name = PurePosixPath(recording.id.replace("\\", "/"))
        if name.is_absolute() or ".." in name.parts or not name.name or "\0" in recording.id:
            raise CorpusError(
                f"got a recording named {recording.id!r}; expected a relative path without `..`"
            )
        if recording.id in seen:
            raise CorpusError(
                f"two recordings are named {recording.id!r}; give each an `id` of its own in a "
                ".csv or .jsonl list"
            )
        seen.add(recording.id)
