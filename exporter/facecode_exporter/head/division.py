"""Which vertices of the demo head are lips and which upper face, for systems of two parts.

The lip part is all that speech moves: lips, jaw, chin, tongue and the lower cheeks. The border runs
where mouth units and the others move the skin equally little, so that it cuts through no motion.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import AnyArray, Faces, Float32, Indices, Offsets, Template
from facecode_exporter.head.face_units import FACE_UNITS
from facecode_exporter.head.head import Head

LIPS, UPPER_FACE = "lips", "upper_face"
MOUTH_UNITS = ("jaw", "mouth", "tongue", "cheekPuff", "noseSneer")


def part_vertices(head: Head) -> dict[str, Indices]:
    """Vertex indices (n,) int32 of each part, ascending; together every vertex once."""
    mouth = np.array([unit.startswith(MOUTH_UNITS) for unit in FACE_UNITS])

    def greatest_motion(units: NDArray[np.bool_]) -> NDArray[np.float64]:
        squares = np.square(head.unit_offsets[units].astype(np.float64))
        return np.asarray(squares.sum(axis=(0, 2)))

    lips = greatest_motion(mouth) > greatest_motion(~mouth)
    return {
        LIPS: np.flatnonzero(lips).astype(np.int32),
        UPPER_FACE: np.flatnonzero(~lips).astype(np.int32),
    }


def seam_edges(faces: Faces, lips: Indices) -> NDArray[np.int64]:
    """Edges (n, 2) of the mesh with one end among `lips` and the other outside."""
    edges = np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    inside = np.isin(edges, lips)
    return np.asarray(edges[inside[:, 0] != inside[:, 1]], dtype=np.int64)


def stretch(vertices: Offsets, template: Template, edges: NDArray[np.int64]) -> Float32:
    """How much each edge is longer than at rest, (T, n), in the unit of `vertices` (T, V, 3)."""

    def lengths(points: AnyArray) -> AnyArray:
        edge_vectors = points[..., edges[:, 0], :] - points[..., edges[:, 1], :]
        return np.asarray(np.linalg.norm(edge_vectors, axis=-1))

    return np.asarray(lengths(vertices) - lengths(template), dtype=np.float32)
