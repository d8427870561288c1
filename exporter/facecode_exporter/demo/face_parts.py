"""Which vertices of the demo head are lips and which upper face, for systems of two parts.

The lip part is all that speech moves: lips, jaw, chin, tongue and the lower cheeks. The border runs
where mouth units and the others move the skin equally little, so that it cuts through no motion.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Indices
from facecode_exporter.demo.face_units import FACE_UNITS
from facecode_exporter.demo.head import Head

LIPS, UPPER_FACE = "lips", "upper_face"
MOUTH_UNITS = ("jaw", "mouth", "tongue", "cheekPuff", "noseSneer")


def part_vertices(head: Head) -> dict[str, Indices]:
    """Vertex indices (n,) int32 of each part, ascending; together every vertex once."""
    mouth = np.array([unit.startswith(MOUTH_UNITS) for unit in FACE_UNITS])

    def moved(units: NDArray[np.bool_]) -> NDArray[np.float64]:
        squares = np.square(head.unit_offsets[units].astype(np.float64))
        return np.asarray(squares.sum(axis=(0, 2)))

    lips = moved(mouth) > moved(~mouth)
    return {
        LIPS: np.flatnonzero(lips).astype(np.int32),
        UPPER_FACE: np.flatnonzero(~lips).astype(np.int32),
    }
