"""How open each vertex lies to its surroundings: what makes nostrils, ears and the mouth deep.

The face is drawn small from many sides; a vertex that a drawing shows is open to that side
(ambient occlusion by shadow maps). Knows nothing of cameras or colours.
"""

from __future__ import annotations

import numpy as np

from facecode.arrays import Faces, Float32, Template
from facecode.render.raster import draw, nearness_of

SIDES = 32
SIZE = 192  # samples a side
BIAS = 0.02  # of the face's size: nearer than this does not block


def openness(vertices: Template, normals: Template, faces: Faces) -> Float32:
    """(V,) in [0, 1]: the cosine-weighted share of directions that nothing blocks."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    extent = float((high - low).max()) or 1.0
    unit = (vertices - (low + high) / 2) / extent  # within a ball of radius sqrt(3) / 2
    received = np.zeros(len(vertices), np.float32)
    possible = np.full(len(vertices), 1e-6, np.float32)
    for side in _directions(SIDES):
        right, up = _across(side)
        screen = np.stack([unit @ right, unit @ up, unit @ side]).astype(np.float32)
        screen[:2] = (screen[:2] / 1.75 + 0.5) * SIZE
        screen[2] += 2  # nearness, positive
        nearest = nearness_of(draw(screen, faces, (SIZE, SIZE))).reshape(SIZE, SIZE)
        column, row = np.clip(screen[:2], 0, SIZE - 1).astype(np.int64)
        cosine = np.maximum(normals @ side, 0).astype(np.float32)
        received += cosine * (nearest[row, column] <= screen[2] + BIAS)
        possible += cosine
    return np.asarray(received / possible, np.float32)


def _directions(n: int) -> Float32:
    """(n, 3) spread evenly over the sphere: a golden spiral."""
    height = 1 - (2 * np.arange(n) + 1) / n
    angle = np.pi * (1 + 5**0.5) * np.arange(n)
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(angle), height, radius * np.sin(angle)], axis=1).astype(
        np.float32
    )


def _across(side: Float32) -> tuple[Float32, Float32]:
    right = np.cross(side, (0.36, 0.48, 0.80) if abs(side[1]) > 0.9 else (0, 1, 0))
    right = (right / np.linalg.norm(right)).astype(np.float32)
    return right, np.cross(right, side).astype(np.float32)
