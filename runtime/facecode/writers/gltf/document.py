"""A glTF document that grows: tables of JSON objects, and the bytes of the first buffer.

Comes in: numpy arrays. Goes out: their indices in the tables, and in the end a .glb. The same
content is stored once. Knows nothing of faces.
"""

from __future__ import annotations

from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import AnyArray, Float32
from facecode.writers.gltf.container import Tree, padding, to_json, write_container

COMPONENT_TYPES = {"u1": 5121, "u2": 5123, "u4": 5125, "f4": 5126}
TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
VERTICES, INDICES = 34962, 34963
"""What a buffer view is for (`target`)."""
LARGEST_UINT16 = 65534  # as an index, 65535 means another thing


class Document:
    """Tables of a glTF file and the pieces of its first buffer."""

    def __init__(self, tree: Tree, n_bytes: int = 0) -> None:
        """Begin with the tables of `tree`, which is changed, and a first buffer of `n_bytes`."""
        self.tree, self.n_bytes = tree, n_bytes
        self.pieces: list[bytes] = []
        """What has been added to the buffer."""
        self._known: dict[Any, int] = {}

    def add(self, table: str, **item: Any) -> int:  # noqa: ANN401
        """The index of a new item in a table; values of None are left out."""
        rows = self.tree.setdefault(table, [])
        rows.append({key: value for key, value in item.items() if value is not None})
        return len(rows) - 1

    def accessor(
        self,
        values: AnyArray,
        *,
        target: int | None = None,
        normalized: bool = False,
        bounds: bool = False,
    ) -> int:
        """The index of an accessor of values (n,) or (n, 3 or 4), uint8 to uint32 or float32.

        Args:
            values: what it holds.
            target: VERTICES, INDICES or, for animation, None.
            normalized: whether integers mean shares of their largest.
            bounds: whether to state `min` and `max`, as positions and times must.
        """
        data = np.ascontiguousarray(values).astype(values.dtype.newbyteorder("<"), copy=False)
        key = (data.tobytes(), data.dtype.str, data.shape, target, normalized, bounds)
        if key not in self._known:
            view = self.view(key[0], target)
            flags = {"normalized": True} if normalized else {}
            self._known[key] = self._accessor(data, bounds, bufferView=view, **flags)
        return self._known[key]

    def displacements(self, values: Float32) -> int:
        """The index of an accessor of displacements (V, 3), sparse if that is shorter."""
        displaced = np.flatnonzero((values != 0).any(axis=1))
        if not len(displaced):
            displaced = np.zeros(1, np.int64)  # a sparse accessor needs one
        index = narrow(displaced, len(values))
        some = np.ascontiguousarray(values[displaced], "<f4")
        if index.nbytes + some.nbytes >= 12 * len(values):
            return self.accessor(values, target=VERTICES, bounds=True)
        key = (index.tobytes(), some.tobytes(), len(values))
        if key not in self._known:
            sparse = {
                "count": len(displaced),
                "indices": {
                    "bufferView": self.view(key[0]),
                    "componentType": COMPONENT_TYPES[index.dtype.str[1:]],
                },
                "values": {"bufferView": self.view(key[1])},
            }
            self._known[key] = self._accessor(values, True, sparse=sparse)
        return self._known[key]

    def _accessor(self, values: AnyArray, bounds: bool, **how: Any) -> int:  # noqa: ANN401
        rows = values.reshape(len(values), -1)
        return self.add(
            "accessors",
            componentType=COMPONENT_TYPES[values.dtype.str[1:]],
            count=len(rows),
            type=TYPES[rows.shape[1]],
            min=rows.min(axis=0).tolist() if bounds else None,
            max=rows.max(axis=0).tolist() if bounds else None,
            **how,
        )

    def view(self, data: bytes, target: int | None = None) -> int:
        """The index of a buffer view of `data`, which is appended, aligned, to the first buffer."""
        gap = padding(self.n_bytes)
        start = self.n_bytes + gap
        self.pieces += [bytes(gap), data]
        self.n_bytes = start + len(data)
        return self.add(
            "bufferViews", buffer=0, byteOffset=start, byteLength=len(data), target=target
        )

    def write(self, file: BinaryIO) -> None:
        """Write a document that began without bytes as a .glb.

        Raises:
            OutputWriteError: over 4 GiB.
        """
        if self.n_bytes:  # a buffer of no byte is not valid
            self.tree["buffers"] = [{"byteLength": self.n_bytes}]
        write_container(file, to_json(self.tree), self.pieces, self.n_bytes)


def narrow(indices: NDArray[Any], n_vertices: int) -> NDArray[Any]:
    """Indices as uint16 where they fit, else uint32; little endian."""
    return np.asarray(indices, "<u2" if n_vertices - 1 <= LARGEST_UINT16 else "<u4")
