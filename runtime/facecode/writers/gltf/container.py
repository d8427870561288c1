"""The .glb container: a header, the JSON chunk, the binary chunk.

Comes in: the JSON and the bytes of its first buffer, in pieces. Goes out: the file, front to
back, without a seek. Knows nothing of what the JSON says.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable, Iterator
from typing import Any, BinaryIO, TypeAlias

from facecode.errors import OutputWriteError

Tree: TypeAlias = dict[str, Any]
"""What `json` makes of an object."""

MAGIC, VERSION = b"glTF", 2
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
HEADER, CHUNK = struct.Struct("<4sII"), struct.Struct("<II")
ALIGNMENT = 4
LARGEST = (1 << 32) - 1  # lengths have 32 bits


def padding(n_bytes: int) -> int:
    """How many bytes to the next multiple of ALIGNMENT."""
    return -n_bytes % ALIGNMENT


def write_container(
    file: BinaryIO,
    text: bytes,
    pieces: Iterable[bytes],
    n_bytes: int,
    after: Iterable[bytes] = (),
    n_after: int = 0,
) -> None:
    """Write a .glb.

    Args:
        file: open, binary; need not seek.
        text: the JSON.
        pieces: the binary chunk, one after the other.
        n_bytes: of all pieces.
        after: whole chunks of other kinds, to follow as they are.
        n_after: their bytes.

    Raises:
        OutputWriteError: over 4 GiB.
    """
    text += b" " * padding(len(text))
    chunks = [(JSON_CHUNK, len(text), iter([text]))]
    if n_bytes:
        chunks.append((BINARY_CHUNK, n_bytes + padding(n_bytes), _padded(pieces, n_bytes)))
    total = HEADER.size + sum(CHUNK.size + length for _, length, _ in chunks) + n_after
    if total > LARGEST:
        raise OutputWriteError(f".glb holds 4 GiB, and this would take {total / 2**30:.1f}")
    file.write(HEADER.pack(MAGIC, VERSION, total))
    for kind, length, content in chunks:
        file.write(CHUNK.pack(length, kind))
        for piece in content:
            file.write(piece)
    for piece in after:
        file.write(piece)


def to_json(tree: Tree) -> bytes:
    """The JSON text in UTF-8, keys in the order of the tree.

    Raises:
        ValueError: NaN or infinity, which JSON cannot say.
    """
    text = json.dumps(tree, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.encode("utf-8", "backslashreplace")  # half a surrogate pair stays its JSON escape


def _padded(pieces: Iterable[bytes], n_bytes: int) -> Iterator[bytes]:
    yield from pieces
    yield bytes(padding(n_bytes))
