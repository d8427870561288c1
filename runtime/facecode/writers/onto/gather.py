"""One .glb of a glTF file and what lies beside it: buffers and images move into the first buffer.

Comes in: a source. Goes out: its JSON, changed where it pointed outside, and the pieces of its one
buffer. A binary chunk stays where it is, byte for byte. Buffers without bytes (the stand-in of
meshopt compression is one) stay entries.
"""

from __future__ import annotations

import base64
import binascii
import re
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote

from facecode.errors import OntoError
from facecode.writers.gltf.container import Tree, padding
from facecode.writers.onto.checked import part, rows, shown, whole
from facecode.writers.onto.source import Piece, Source, Span

_BASE64 = re.compile(r"data:[^,]*;base64,", re.IGNORECASE)
IMAGE_TYPES = {
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".webp": "image/webp",
    ".avif": "image/avif",
    ".ktx2": "image/ktx2",
    ".dds": "image/vnd-ms.dds",
}


@dataclass
class Gathered:
    """The first buffer of a file in pieces."""

    pieces: list[Piece] = field(default_factory=list)
    n_bytes: int = 0
    relocated: list[str] = field(default_factory=list)
    """What was brought in, in words, with its range of bytes."""

    def append(self, piece: Piece, what: str | None) -> int:
        """Where the piece begins, aligned; `what` it is, unless it was there already."""
        gap = padding(self.n_bytes)
        start = self.n_bytes + gap
        length = len(piece) if isinstance(piece, bytes) else piece.length
        self.pieces += [bytes(gap), piece]
        self.n_bytes = start + length
        if what is not None:
            self.relocated.append(
                f"{what} is now bytes {start} to {self.n_bytes} of the first buffer"
            )
        return start


def gather(source: Source) -> Gathered:
    """Bring in all that the JSON of a source points at, and change the JSON (in place) to say so.

    Raises:
        OntoError: something is missing, too short, or outside the folder of the source.
    """
    found = Gathered()
    _gather_buffers(source, found)
    _gather_images(source, found)
    return found


def _gather_buffers(source: Source, found: Gathered) -> None:
    old = rows(source.tree, "buffers")
    new: list[Tree] = [{"byteLength": 0}]
    places: list[tuple[int, int]] = []  # of each old buffer: (new buffer, where it begins there)
    for index, buffer in enumerate(old):
        piece = _content(source, buffer, index)
        if piece is None:
            places.append((len(new), 0))
            new.append(buffer)
            continue
        if not found.pieces:
            new[0] = buffer
        there = piece is source.binary
        start = found.append(piece, None if there else f"buffer {shown(_title(buffer, index))}")
        buffer.pop("uri", None)
        places.append((0, start))
    source.tree["buffers"] = new
    if places != [(index, 0) for index in range(len(old))]:
        for view in rows(source.tree, "bufferViews"):
            _move(view, places)
            for extension in part(view, "extensions").values():
                if isinstance(extension, dict) and "buffer" in extension:
                    _move(extension, places)


def _content(source: Source, buffer: Tree, index: int) -> Piece | None:
    length = whole(buffer.get("byteLength"), f"byteLength of buffer {index}")
    uri = buffer.get("uri")
    if uri is None:
        if index or source.binary is None:
            return None
        _require(source.binary.length, length, "the binary chunk")
        return source.binary
    if index == 0 and source.binary is not None:
        raise OntoError("broken glTF: buffer 0 lies outside the file, which has a binary chunk")
    if not isinstance(uri, str):
        raise OntoError(f"broken glTF: uri of buffer {index} is {shown(uri)}; expected text")
    what = f"buffer {index} ({shown(uri)})"
    if uri[:5].lower() == "data:":
        data = _decoded(uri, what)
        _require(len(data), length, what)
        return data[:length]
    path = _beside(source.path.parent, uri, what)
    _require(path.stat().st_size, length, what)
    return Span(path, 0, length)


def _require(size: int, length: int, what: str) -> None:
    if size < length:
        raise OntoError(f"{what} is truncated: {length} bytes are stated, and it has {size}")


def _title(buffer: Tree, index: int) -> str:
    uri = buffer.get("uri")
    return uri if isinstance(uri, str) and uri[:5].lower() != "data:" else f"{index}"


def _move(view: Tree, places: list[tuple[int, int]]) -> None:
    buffer, start = places[whole(view.get("buffer"), "buffer of a buffer view", len(places))]
    view["buffer"] = buffer
    if start:
        view["byteOffset"] = whole(view.get("byteOffset", 0), "byteOffset of a view") + start


def _gather_images(source: Source, found: Gathered) -> None:
    views = rows(source.tree, "bufferViews")
    for index, image in enumerate(rows(source.tree, "images")):
        uri = image.get("uri")
        if not isinstance(uri, str) or uri[:5].lower() == "data:":
            continue
        what = f"image {index} ({shown(uri)})"
        path = _beside(source.path.parent, uri, what)
        kind = image.get("mimeType", IMAGE_TYPES.get(path.suffix.lower()))
        if kind is None:
            raise OntoError(f"{what}: expected one of {', '.join(IMAGE_TYPES)}")
        length = path.stat().st_size
        start = found.append(Span(path, 0, length), f"image {shown(uri)}")
        views.append({"buffer": 0, "byteOffset": start, "byteLength": length})
        del image["uri"]
        image |= {"mimeType": kind, "bufferView": len(views) - 1}
        source.tree["bufferViews"] = views


def _decoded(uri: str, what: str) -> bytes:
    head = _BASE64.match(uri)
    try:
        if head is None:
            raise ValueError("it is not base64")
        return base64.b64decode(uri[head.end() :], validate=True)
    except (ValueError, binascii.Error) as error:
        raise OntoError(f"{what} cannot be decoded: {error}") from error


def _beside(folder: Path, uri: str, what: str) -> Path:
    """The file that a relative reference names, in the folder or below it.

    Raises:
        OntoError
    """
    name = unquote(uri)
    parts = re.split(r"[/\\]", name)
    inside = parts[0] and ":" not in parts[0] and "\0" not in name
    try:
        path = folder.joinpath(*parts) if inside else folder
        inside = inside and path.resolve().is_relative_to(folder.resolve())
        there = path.is_file()
    except (OSError, RuntimeError) as error:  # a name too long, or links in a circle
        reason = getattr(error, "strerror", None) or "links go in a circle"
        raise OntoError(f"{what} cannot be read: {reason}") from error
    if not inside:
        raise OntoError(f"{what} lies outside the folder of the avatar; put it there")
    if not there:
        raise OntoError(f"{what} is missing; it belongs into {folder}")
    return path
