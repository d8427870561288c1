"""Which triangle is seen at each sample of an image: a z-buffer in whole-array numpy.

Comes in: vertices on the screen. Goes out: per sample the nearest triangle. Knows nothing of
cameras, lights or colours. A triangle becomes the rows it crosses, a row the samples between its
two edges (Pineda's inclusion test is not needed), and one `maximum.at` over packed (depth,
triangle) keys settles them all. Shared edges are cut from the same two points: no cracks.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Faces, Float32

Keys: TypeAlias = NDArray[np.int64]
"""(height * width,): float32 bits of the nearness in the high half, triangle in the low; 0 empty"""
Int: TypeAlias = NDArray[np.int64]

SMALLEST_AREA = 1e-6  # samples^2, twice the area; thinner triangles have no stable depth
CHUNK = 1 << 15  # samples at a time: what they need stays in the cache; 62 to 42 ms a head
_LOW_HALF = 0xFFFFFFFF


def draw(screen: Float32, faces: Faces, size: tuple[int, int]) -> Keys:
    """Draw triangles, both sides; the nearest wins.

    Args:
        screen: (3, V) float32: x to the right and y down in samples, and a positive nearness
            that is linear on the screen, such as 1 / distance.
        faces: (F, 3) vertex indices. Those with a vertex that is not finite are left out.
        size: (height, width) in samples.
    """
    keys = np.zeros(size[0] * size[1], np.int64)
    corners = screen[:, faces]  # (3, F, 3)
    order = np.argsort(corners[1], axis=1, kind="stable")
    x, y, near = np.take_along_axis(corners, order[None], axis=2)
    area = cross(x, y)
    drawn = np.abs(area) > SMALLEST_AREA
    drawn &= np.isfinite(corners).all(axis=(0, 2))
    chosen = np.flatnonzero(drawn)
    if len(chosen) < len(faces):
        x, y, near, area = x[drawn], y[drawn], near[drawn], area[drawn]
    for pixel, nearness, triangle in _samples(x, y, near, area, size):
        packed = nearness.view(np.int32).astype(np.int64)
        packed <<= 32
        packed |= chosen[triangle]
        np.maximum.at(keys, pixel, packed)
    return keys


def triangle_of(keys: Keys) -> NDArray[np.int64]:
    """The triangle of each sample; meaningless where the key is 0."""
    return keys & _LOW_HALF


def nearness_of(keys: Keys) -> Float32:
    """The nearness of each sample; 0 where nothing was drawn."""
    return (keys >> 32).astype(np.int32).view(np.float32)


def cross(x: Float32, y: Float32) -> Float32:
    """(n,) twice the area of triangles with corners x, y (n, 3); the sign tells the side."""
    return np.asarray(
        (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])
    )


def _samples(
    x: Float32, y: Float32, near: Float32, area: Float32, size: tuple[int, int]
) -> Iterator[tuple[Int, Float32, Int]]:
    """Sample index, nearness and triangle of all samples; corners (n, 3) are sorted by y."""
    height, width = size
    first = _centres(y[:, 0], height)
    n_rows = _centres(y[:, 2], height) - first
    triangle = np.repeat(np.arange(len(x)), n_rows)
    row = _counting(n_rows)
    row += first[triangle]
    centre = row.astype(np.float32)
    centre += np.float32(0.5)

    with np.errstate(divide="ignore", invalid="ignore"):  # level edges cross no row
        long, upper, lower = ((x[:, b] - x[:, a]) / (y[:, b] - y[:, a])
                              for a, b in ((0, 2), (0, 1), (1, 2)))  # fmt: skip
    below = centre >= y[:, 1][triangle]
    edge = triangle + below * len(x)  # row of the tables of upper, then lower edges
    down = centre - y[:, 0][triangle]
    one = down * long[triangle]
    one += x[:, 0][triangle]
    other = centre - y[:, :2].T.ravel()[edge]
    other *= np.concatenate([upper, lower])[edge]
    other += x[:, :2].T.ravel()[edge]
    start = _centres(np.minimum(one, other), width)
    n_samples = _centres(np.maximum(one, other), width) - start

    by_x, by_y = gradients(x, y, near, area)
    step = by_x[triangle]
    at_start = start.astype(np.float32)
    at_start -= (x[:, 0] - np.float32(0.5))[triangle]
    at_start *= step
    at_start += near[:, 0][triangle]
    down *= by_y[triangle]
    at_start += down
    first_sample = row * width + start
    ends = np.cumsum(n_samples)
    if not n_samples.any():
        return
    cuts = np.searchsorted(ends, np.arange(0, ends[-1], CHUNK)).tolist()
    for one_cut, next_cut in zip(cuts, [*cuts[1:], len(row)], strict=True):
        rows = slice(one_cut, next_cut)
        line = np.repeat(np.arange(next_cut - one_cut), n_samples[rows])
        along = _counting(n_samples[rows])
        nearness = along.astype(np.float32)
        nearness *= step[rows][line]
        nearness += at_start[rows][line]
        along += first_sample[rows][line]
        yield along, nearness, triangle[rows][line]


def gradients(x: Float32, y: Float32, values: Float32, area: Float32) -> tuple[Float32, Float32]:
    """d/dx and d/dy (..., n) of values (..., n, 3) given at corners x, y (n, 3)."""
    one, two = values[..., 1] - values[..., 0], values[..., 2] - values[..., 0]
    by_x = one * (y[:, 2] - y[:, 0]) - two * (y[:, 1] - y[:, 0])
    by_y = two * (x[:, 1] - x[:, 0]) - one * (x[:, 2] - x[:, 0])
    by_x /= area
    by_y /= area
    return by_x, by_y


def _centres(position: Float32, end: int) -> Int:
    """The first sample whose centre is at or after `position`, within [0, end]."""
    return np.asarray(np.ceil(np.clip(position, 0, end) - np.float32(0.5)), np.int64)


def _counting(counts: Int) -> Int:
    """0 .. count - 1 for each count, one after the other."""
    ends = np.cumsum(counts)
    return np.arange(ends[-1] if len(ends) else 0) - np.repeat(ends - counts, counts)
