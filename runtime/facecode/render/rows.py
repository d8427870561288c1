"""What triangles cover of each row of an image.

Comes in: vertices on the screen. Goes out: rows of pixels, each between two edges of a triangle
(Pineda's inclusion test is not needed). A triangle is two halves, above and below its middle
corner; halves of like height are computed side by side, so that no row looks anything up. Shared
edges are cut from the same two points: no cracks.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Faces, Float32

Int: TypeAlias = NDArray[np.int64]
Int32: TypeAlias = NDArray[np.int32]

SMALLEST_AREA = 2.5e-7  # pixels^2, twice the area; thinner triangles have no stable depth


class Rows(NamedTuple):
    """Rows of pixels that a triangle covers, (n,) each."""

    first: Int32  # pixel
    length: Int32
    near: Float32  # at the centre of the first pixel
    step: Float32  # to the next pixel
    triangle: Int32

    def at(self, which: Int) -> Rows:
        """These of the rows."""
        floats, ints = (self.near, self.step), (self.first, self.length, self.triangle)
        near, step = (np.take(values, which) for values in floats)
        first, length, triangle = (np.take(values, which) for values in ints)
        return Rows(first, length, near, step, triangle)


def corners_of(screen: Float32, faces: Faces) -> Float32:
    """(3, 3, F) of vertices (3, V): x, y and nearness of the corners, in the order of their y."""
    corner = np.array(faces.T, order="C")
    y = np.take(screen[1], corner)
    for a, b in ((0, 1), (1, 2), (0, 1)):
        change = (corner[b] - corner[a]) * (y[b] < y[a])
        corner[a] += change
        corner[b] -= change
        y[a], y[b] = np.minimum(y[a], y[b]), np.maximum(y[a], y[b])
    return np.take(screen, corner, axis=1)


def rows_of(corners: Float32, number: Int, size: tuple[int, int]) -> Rows:
    """The rows of triangles, both sides.

    Args:
        corners: (3, 3, F) as `corners_of` gives them; those that are not finite are left out.
        number: (F,) what the triangles are called.
        size: (height, width) in pixels.
    """
    x, y, near = corners
    with np.errstate(all="ignore"):  # triangles that are not drawn
        area = cross(x, y)
        drawn = (np.abs(area) > SMALLEST_AREA) & np.isfinite(x + y + near).all(axis=0)
        long, upper, lower = ((x[b] - x[a]) / (y[b] - y[a]) for a, b in ((0, 2), (0, 1), (1, 2)))
        by_x, by_y = gradients(x, y, near, area)
        ends = first_from(y - np.float32(0.5), size[0])
    top, n_rows = ends[:2].ravel(), (np.diff(ends, axis=0) * drawn).ravel()
    order = np.argsort(n_rows.astype(np.int16), kind="stable")
    order = order[np.searchsorted(n_rows, 0, side="right", sorter=order) :]
    half = np.stack([x[:2].ravel(), y[:2].ravel(), np.concatenate([upper, lower])])
    whole = np.stack([x[0], y[0], long, near[0], by_x, by_y])
    triangle = order % len(number)
    lines = np.concatenate([np.take(half, order, axis=1), np.take(whole, triangle, axis=1)])
    lines[[0, 1, 3, 4]] -= np.float32(0.5)  # so that the centre of a pixel lies at its number
    counts = np.stack([top[order], n_rows[order], number[triangle]]).astype(np.int32)
    bands = [
        _band(lines[:, band], counts[:, band], height, size[1])
        for band, height in _of_like_height(counts[1])
    ]
    return Rows(*(np.concatenate(parts) for parts in zip(*bands, strict=True)))


def first_from(position: Float32, end: int) -> Int32:
    """The first whole number at or after `position`, within [0, end]; `end` for nan."""
    return np.asarray(np.ceil(np.fmax(np.fmin(position, end), 0)), np.int32)


def cross(x: Float32, y: Float32) -> Float32:
    """(n,) twice the area of triangles with corners x, y (3, n); the sign tells the side."""
    return np.asarray((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))


def gradients(x: Float32, y: Float32, values: Float32, area: Float32) -> tuple[Float32, Float32]:
    """d/dx and d/dy (..., n) of values (..., 3, n) given at corners x, y (3, n)."""
    one = values[..., 1, :] - values[..., 0, :]
    two = values[..., 2, :] - values[..., 0, :]
    by_x = one * (y[2] - y[0]) - two * (y[1] - y[0])
    by_y = two * (x[1] - x[0]) - one * (x[2] - x[0])
    by_x /= area
    by_y /= area
    return by_x, by_y


def _of_like_height(n_rows: Int32) -> Iterator[tuple[slice, int]]:
    """Halves, sorted by their number of rows, with at most 1, 2, 4, 8, ... rows."""
    heights = 1 << np.arange(int(n_rows.max(initial=1) - 1).bit_length() + 1)
    cuts = np.searchsorted(n_rows, heights, side="right").tolist()
    for start, end, height in zip([0, *cuts[:-1]], cuts, heights.tolist(), strict=True):
        yield slice(start, end), height


def _band(lines: Float32, counts: Int32, height: int, width: int) -> Rows:
    """The rows of halves with at most `height` rows each, (height, n) arrays."""
    (x1, y1, short, x0, y0, long, near, by_x, by_y), (top, n_rows, number) = lines, counts
    line = np.arange(height, dtype=np.int32)[:, None]
    row = top + line
    y = row.astype(np.float32)
    down = y - y0
    one = down * long
    one += x0
    y -= y1
    y *= short
    y += x1
    first = first_from(np.minimum(one, y), width)
    length = first_from(np.maximum(one, y), width)
    length -= first
    length *= line < n_rows
    down *= by_y
    down += near
    along = first.astype(np.float32)
    along -= x0
    along *= by_x
    along += down
    row *= width
    row += first
    which = np.flatnonzero(length)
    half = which % max(lines.shape[1], 1)
    row, length, along = (np.take(each, which) for each in (row, length, along))
    return Rows(row, length, along, np.take(by_x, half), np.take(number, half))
