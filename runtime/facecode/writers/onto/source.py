"""A foreign .glb, .vrm or .gltf, read so far that it can be written again with more in it.

Comes in: a path. Goes out: its JSON, and where the bytes of its buffers lie; they are copied only
when they are written. Every length is held against the file's size before anything is read.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from facecode.errors import AvatarNotFoundError, OntoError
from facecode.writers.gltf.container import (
    BINARY_CHUNK,
    CHUNK,
    HEADER,
    JSON_CHUNK,
    MAGIC,
    VERSION,
    Tree,
)
from facecode.writers.onto.checked import part, shown

LONGEST_JSON = 256 << 20  # bytes; buffers written into a .gltf as text count
BLOCK = 1 << 20


@dataclass(frozen=True)
class Span:
    """Bytes of a file, read when they are needed."""

    path: Path
    start: int
    length: int

    def blocks(self) -> Iterator[bytes]:
        """The bytes, a block at a time.

        Raises:
            OntoError: they cannot be read, or the file has become shorter.
        """
        left = self.length
        try:
            with self.path.open("rb") as file:
                file.seek(self.start)
                while left and (block := file.read(min(left, BLOCK))):
                    left -= len(block)
                    yield block
        except OSError as error:
            raise OntoError(f"cannot read {self.path}: {error.strerror or error}") from error
        if left:
            raise OntoError(f"{self.path} ended {left} bytes early; it changed while it was read")


Piece: TypeAlias = "bytes | Span"


def blocks(pieces: Iterable[Piece]) -> Iterator[bytes]:
    """The bytes of pieces, one after the other.

    Raises:
        OntoError: a file cannot be read.
    """
    for piece in pieces:
        if isinstance(piece, bytes):
            yield piece
        else:
            yield from piece.blocks()


@dataclass(frozen=True)
class Source:
    """A glTF file as it lies on the disk."""

    path: Path
    tree: Tree
    binary: Span | None
    """The binary chunk of a .glb."""
    after: Span
    """What follows it: chunks of other kinds."""


def read_source(path: Path) -> Source:
    """Read a .glb (or .vrm, which is one) or the JSON of a .gltf; the content tells which.

    Raises:
        AvatarNotFoundError: no such file.
        OntoError: it cannot be read, is truncated, or is no glTF 2.0.
    """
    if not path.exists():
        raise AvatarNotFoundError(f"no avatar at {path}; expected a .glb, .vrm or .gltf")
    if not path.is_file():
        raise OntoError(f"{path} is no file; expected a .glb, .vrm or .gltf")
    size = path.stat().st_size
    header = _read(Span(path, 0, min(size, HEADER.size)))
    if not header.startswith(MAGIC):
        tree = _parsed(Span(path, 0, size))
        return Source(path, tree, None, Span(path, size, 0))
    end = _container_end(path, header, size)
    kind, text = _chunk(path, HEADER.size, end)
    if kind != JSON_CHUNK:
        raise OntoError(f"{path.name}: the first chunk is not JSON, so it is no glTF 2.0")
    tree, position, binary = _parsed(text), text.start + text.length, None
    if position < end:
        kind, content = _chunk(path, position, end)
        if kind == BINARY_CHUNK:
            position, binary = content.start + content.length, content
    return Source(path, tree, binary, Span(path, position, end - position))


def _container_end(path: Path, header: bytes, size: int) -> int:
    if len(header) < HEADER.size:
        raise OntoError(f"{path.name} is truncated: {size} bytes, less than a .glb's header")
    _, version, length = HEADER.unpack(header)
    if version != VERSION:
        raise OntoError(f"{path.name} is glTF {version}; expected glTF 2, so export it anew")
    if not HEADER.size <= length <= size:
        raise OntoError(f"{path.name} is truncated: it states {length} bytes and has {size}")
    return int(length)


def _chunk(path: Path, start: int, end: int) -> tuple[int, Span]:
    """The type and the content of the chunk at `start`."""
    content = start + CHUNK.size
    if content > end:
        raise OntoError(f"{path.name} is truncated: no chunk at byte {start}")
    length, kind = CHUNK.unpack(_read(Span(path, start, CHUNK.size)))
    if length > end - content:
        raise OntoError(
            f"{path.name} is truncated: the chunk at byte {start} states {length} bytes, and "
            f"{end - content} are left"
        )
    return kind, Span(path, content, length)


def _read(span: Span) -> bytes:
    return b"".join(span.blocks())


def _parsed(span: Span) -> Tree:
    name = span.path.name
    if span.length > LONGEST_JSON:
        raise OntoError(
            f"{name} has {span.length >> 20} MiB of JSON, or is no glTF; at most "
            f"{LONGEST_JSON >> 20} are read"
        )
    try:
        tree = json.loads(
            _read(span).decode("utf-8-sig"), parse_constant=_finite, parse_float=_finite
        )
    except (ValueError, RecursionError) as error:
        raise OntoError(f"{name} is no glTF: its JSON cannot be read: {shown(error)}") from error
    version = part(tree, "asset").get("version") if isinstance(tree, dict) else None
    if not isinstance(version, str) or not version.startswith("2."):
        raise OntoError(f"{name} is no glTF 2.0: its asset.version is {shown(version)}")
    return tree  # type: ignore[no-any-return]  # a dict, as `version` tells


def _finite(text: str) -> float:
    value = float(text)
    if not abs(value) < float("inf"):
        raise ValueError(f"{text[:20]} is no number of JSON")
    return value
