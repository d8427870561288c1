"""Which triangle is seen at each pixel of an image: a z-buffer in whole-array numpy.

Comes in: vertices on the screen. Goes out: per pixel the triangle that is nearest at its centre.
Knows nothing of cameras, lights or colours. `maximum.at` over packed (depth, triangle) keys settles
who is seen: for the first pixel of all rows, then the second of those that have one, and so on.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from facecode.arrays import Faces, Float32
from facecode.render.region import SAMPLES, Region
from facecode.render.rows import Int, Int32, Rows, corners_of, rows_of

Keys: TypeAlias = Int
"""(n_pixels,): float32 bits of the nearness in the high half, triangle in the low; 0 empty"""

_LOW_HALF = 0xFFFFFFFF


def draw(screen: Float32, faces: Faces, size: tuple[int, int]) -> Keys:
    """Draw triangles, both sides; the nearest wins.

    Args:
        screen: (3, V) float32: x to the right and y down in pixels, and a positive nearness
            that is linear on the screen, such as 1 / distance.
        faces: (F, 3) vertex indices. Those with a vertex that is not finite are left out.
        size: (height, width) in pixels.
    """
    rows = rows_of(corners_of(screen, faces), np.arange(len(faces)), size)
    return _nearest(size[0] * size[1], rows, rows.first, rows.length)


def draw_samples(screen: Float32, faces: Faces, region: Region) -> Keys:
    """What is seen at the samples of a region's n pixels: (SAMPLES down, n, SAMPLES right).

    Args:
        screen: (3, V), see `draw`.
        faces: (F, 3), see `draw`.
        region: of the image that `draw` would draw.
    """
    touched = region.touched(screen, faces)
    fine = screen * np.array([[SAMPLES], [SAMPLES], [1]], np.float32)
    height, width = (side * SAMPLES for side in region.size)
    rows = rows_of(corners_of(fine, faces[touched]), touched, (height, width))
    line, column = np.divmod(rows.first, width)
    pixel_line, down = np.divmod(line, SAMPLES)
    rows = rows._replace(first=pixel_line * width + column)
    place, length = region.within(rows.first, rows.length)
    place += down * len(region.across)
    pixels = np.tile(region.across, SAMPLES)
    keys = _nearest(len(pixels), rows, place, length, pixels)
    return keys.reshape(SAMPLES, -1, SAMPLES)


def triangle_of(keys: Keys) -> Int:
    """The triangle of each pixel; meaningless where the key is 0."""
    return keys & _LOW_HALF


def nearness_of(keys: Keys) -> Float32:
    """The nearness of each pixel; 0 where nothing was drawn."""
    return (keys >> 32).astype(np.int32).view(np.float32)


def _nearest(
    n_keys: int, rows: Rows, place: Int32, length: Int32, pixels: Int | None = None
) -> Keys:
    """Each row reaches `length` of the keys from `place` on: its pixels, or those of `pixels`."""
    keys = np.zeros(n_keys, np.int64)
    longest = int(length.max(initial=0))
    some = np.flatnonzero(length)
    length = np.take(length, some).astype(np.min_scalar_type(longest))  # bytes: sorted in one pass
    order = np.argsort(length, kind="stable")
    shorter = np.searchsorted(length, np.arange(longest), side="right", sorter=order).tolist()
    order = some[order]
    rows, begin = rows.at(order), np.take(place, order).astype(np.int64)
    triangle = rows.triangle.astype(np.int64)
    for along, skipped in enumerate(shorter):
        there = begin[skipped:] + along
        if pixels is None:
            near = rows.step[skipped:] * np.float32(along)
        else:
            near = (np.take(pixels, there) - rows.first[skipped:]).astype(np.float32)
            near *= rows.step[skipped:]
        near += rows.near[skipped:]
        key = near.view(np.int32).astype(np.int64)
        key <<= 32
        key |= triangle[skipped:]
        np.maximum.at(keys, there, key)
    return keys
