"""The pixels of one frame.

Comes in: what is seen, and its attributes. Goes out: sRGB. A pixel on one stretch of skin is shaded
once, at its centre; one that shows several has SAMPLES x SAMPLES samples, as multisampling does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Faces, Float32
from facecode.render import light, raster
from facecode.render.region import SAMPLES, Region
from facecode.render.rows import Int
from facecode.render.surface import Planes

CHUNK = 1 << 14  # pixels shaded at a time: what they need stays in the cache

Picture = NDArray[np.uint8]


def paint_once(
    picture: Picture, pixels: Int, keys: raster.Keys, planes: Planes, width: int
) -> None:
    """Paint pixels (n,) with what is seen at their centres.

    Args:
        picture: (3, height * width), changed.
        pixels: (n,) of the picture.
        keys: (height * width,) what is seen.
        planes: its attributes.
        width: of the picture.
    """
    for start in range(0, len(pixels), CHUNK):
        pixel = pixels[start : start + CHUNK]
        triangle = raster.triangle_of(np.take(keys, pixel))
        seen = light.to_srgb(planes.shade(triangle, *_position(pixel, width, 0.5, 0.5)))
        for channel, values in zip(picture, seen, strict=True):  # thrice as fast as all at once
            channel[pixel] = values


def edge_light(
    region: Region, screen: Float32, faces: Faces, planes: Planes, behind: Float32
) -> Float32:
    """Linear RGB (3, n) of the pixels of a region, from all samples.

    Args:
        region: its n pixels.
        screen: (3, V) vertices in pixels.
        faces: (F, 3) what is drawn.
        planes: its attributes.
        behind: (3, n) linear light where nothing is drawn.
    """
    total = np.zeros_like(behind)
    keys = raster.draw_samples(screen, faces, region)
    for down, right in np.ndindex(SAMPLES, SAMPLES):
        there = np.flatnonzero(keys[down, :, right])
        place = ((right + 0.5) / SAMPLES, (down + 0.5) / SAMPLES)
        position = _position(region.pixels[there], region.size[1], *place)
        seen = behind.copy()
        seen[:, there] = planes.shade(raster.triangle_of(keys[down, there, right]), *position)
        total += seen
    total /= SAMPLES**2
    return total


def _position(pixel: Int, width: int, right: float, down: float) -> tuple[Float32, Float32]:
    row = pixel // width
    return np.asarray(pixel - row * width + right, np.float32), np.asarray(row + down, np.float32)
