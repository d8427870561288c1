"""What an .onnx file would read beside itself, and its loops, found without the onnx package.

onnxruntime follows such paths on its own when it loads a graph, so they are looked at first.
Reads the few protobuf fields that lead to a tensor (field numbers of onnx.proto3) and skips the
weights, so that a graph of hundreds of megabytes takes milliseconds.
"""

from __future__ import annotations

import mmap
from collections.abc import Iterator
from pathlib import Path

# message -> {field number: message of that field}; only the ways that lead to a TensorProto
CHILDREN = {
    "Model": {7: "Graph", 25: "Function"},
    "Graph": {1: "Node", 5: "Tensor", 15: "SparseTensor"},
    "Function": {7: "Node", 11: "Attribute"},
    "Node": {5: "Attribute"},
    "Attribute": {
        5: "Tensor",
        6: "Graph",
        10: "Tensor",
        11: "Graph",
        22: "SparseTensor",
        23: "SparseTensor",
    },
    "SparseTensor": {1: "Tensor", 2: "Tensor"},
    "Tensor": {13: "ExternalData"},
    "ExternalData": {},
}
OP_TYPE = 4
VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5


LOOPS = {b"Loop", b"Scan", b"SequenceMap"}
"""Operators that may never end; no graph of facecode has one."""


def external_files(path: Path) -> list[str]:
    """Locations that the tensors of the graph at `path` point to, as written there.

    Raises:
        ValueError: not a protobuf message, or a graph with a loop.
    """
    with path.open("rb") as file:
        if path.stat().st_size == 0:
            raise ValueError("the file is empty")
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            return list(_locations(data, 0, len(data), "Model"))


def _locations(data: mmap.mmap, start: int, end: int, message: str) -> Iterator[str]:
    children = CHILDREN[message]
    key = value = b""
    for field, first, last in _fields(data, start, end):
        if field in children:
            yield from _locations(data, first, last, children[field])
        elif message == "ExternalData":
            key = data[first:last] if field == 1 else key
            value = data[first:last] if field == 2 else value
        elif message == "Node" and field == OP_TYPE and data[first:last] in LOOPS:
            raise ValueError(f"it has the operator {data[first:last].decode()}, which may not end")
    if key == b"location":
        yield value.decode("utf-8", "replace")


def _fields(data: mmap.mmap, start: int, end: int) -> Iterator[tuple[int, int, int]]:
    """The length-delimited fields of a message: number, first byte, byte after the last."""
    at = start
    while at < end:
        tag, at = _varint(data, at, end)
        wire = tag & 7
        if wire == BYTES:
            size, at = _varint(data, at, end)
            if at + size > end:
                raise ValueError("a field runs past its message")
            yield tag >> 3, at, at + size
            at += size
        elif wire == VARINT:
            _, at = _varint(data, at, end)
        elif wire in (FIXED64, FIXED32):
            at += 8 if wire == FIXED64 else 4
        else:
            raise ValueError(f"wire type {wire}")


def _varint(data: mmap.mmap, at: int, end: int) -> tuple[int, int]:
    value = shift = 0
    while at < end and shift < 64:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            return value, at
    raise ValueError("a number runs past its message")
