"""The skin between the vertices: normals, connected pieces, and attributes over the screen.

Knows nothing of pictures.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Faces, Float32, Template
from facecode.render import light
from facecode.render.rows import Int, cross, gradients

INSIDE = 0.12  # share of the light for a surface seen from behind


class Planes:
    """Attributes over the screen: of each triangle the value at a corner and two gradients."""

    def __init__(self, screen: Float32, faces: Faces, attributes: Float32) -> None:
        """Spread attributes (7, V), that `shade` describes, over triangles (F, 3)."""
        (x, y), values = (np.take(of, faces.T, axis=1) for of in (screen[:2], attributes))
        area = cross(x, y)
        with np.errstate(divide="ignore", invalid="ignore"):  # triangles that nobody sees
            by_x, by_y = gradients(x, y, values, area)
        self._corner = np.stack([x[0], y[0]])
        self._from_behind = area > 0
        self._table = np.stack([values[:, 0], by_x, by_y])

    def shade(self, triangle: Int, x: Float32, y: Float32) -> Float32:
        """Linear RGB (3, n) of samples at x, y on their triangles.

        The attributes are a normal in the camera's axes, a linear colour, and openness.
        """
        right, down = np.take(self._corner, triangle, axis=1)
        np.subtract(x, right, out=right)
        np.subtract(y, down, out=down)
        value, by_x, by_y = np.take(self._table, triangle, axis=2)
        by_x *= right
        by_y *= down
        value += by_x
        value += by_y
        # A pixel's centre may lie just outside its triangle: nothing may run out of range there.
        np.clip(value[3:], 0, 1, out=value[3:])
        seen = light.shade(value[:3], value[3:6], value[6])
        if self._from_behind.any():
            seen *= np.where(self._from_behind[triangle], np.float32(INSIDE), np.float32(1))
        return seen


def vertex_normals(vertices: Template, faces: Faces) -> Template:
    """(V, 3) unit normals, each the mean of its triangles' by area."""
    one, two, three = np.take(vertices.T, faces.T, axis=1).swapaxes(0, 1)
    two -= one
    three -= one
    total = np.empty((3, len(vertices)))
    corners = faces.ravel()
    for axis in range(3):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        across = two[a] * three[b] - two[b] * three[a]
        across[~np.isfinite(across)] = 0
        total[axis] = np.bincount(corners, np.repeat(across, 3), len(vertices))
    length = np.sqrt((total * total).sum(axis=0))
    return np.asarray((total / np.where(length > 0, length, 1)).T, np.float32)


def shells(faces: Faces, n_vertices: int) -> NDArray[np.int64]:
    """(F,) a number for each connected piece: brows and eyeballs lie close to the skin."""
    piece = np.arange(n_vertices)
    while True:
        least = piece.copy()
        np.minimum.at(least, faces, piece[faces].min(axis=1, keepdims=True))
        least = least[least]
        if np.array_equal(least, piece):
            return piece[faces[:, 0]]
        piece = least


def outward(template: Template, faces: Faces) -> Faces:
    """Faces with their corners counter-clockwise seen from outside, as their volume tells."""
    one, two, three = (template - template.mean(axis=0))[faces].transpose(1, 0, 2)
    volume = np.einsum("fi,fi->", one, np.cross(two, three))
    return faces if volume >= 0 else np.ascontiguousarray(faces[:, ::-1])
