"""How the skin answers light: three lamps and a sky, in linear light.

Comes in: normals and colours of samples, channel first. Goes out: linear RGB. Knows nothing of
triangles or pictures. Directions are in the camera's axes: x right, y up, z to the viewer.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Colours, Float32

CLAY = (196, 178, 166)  # of a face without colours
_KEY, _FILL, _RIM = ((-0.55, 0.55, 0.75), (0.85, 0.10, 0.60), (0.60, 0.45, -0.75))
_LAMPS = np.array([_KEY, _FILL, _RIM], np.float32)
LAMPS = _LAMPS / np.linalg.norm(_LAMPS, axis=1, keepdims=True)
LAMP_COLOURS = np.array(
    [(1.04, 0.965, 0.88), (0.14, 0.16, 0.19), (0.50, 0.53, 0.58)], np.float32
)  # warm key, cool fill and rim
SKY, GROUND = np.array([(0.24, 0.25, 0.27), (0.11, 0.095, 0.09)], np.float32)
# Light that enters skin comes out around the corner, red the farthest (as in pre-integrated skin).
WRAP = np.array([0.32, 0.18, 0.12], np.float32)
GLOSS, SHARPNESS = 0.14, 28  # of highlights, as Blinn counts them
SHEEN = 0.10  # of the grazing edge
_HALF = LAMPS[0] + (0, 0, 1)
HALF = (_HALF / np.linalg.norm(_HALF)).astype(np.float32)

BALL = 384  # normals along one axis of the table of light
_STEPS = 4096


def linear(colours: Colours) -> Float32:
    """sRGB uint8 to linear light in [0, 1], any shape."""
    value = colours.astype(np.float32) / 255
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def shade(normals: Float32, colours: Float32, openness: Float32) -> Float32:
    """Linear RGB (3, n).

    Args:
        normals: (3, n) of any length; only where they lean counts, not to which side.
        colours: (3, n) linear.
        openness: (n,) share of the sky that is not blocked, in [0, 1].
    """
    x, y, z = normals
    length = np.sqrt(x * x + y * y + z * z)
    np.maximum(length, 1e-12, out=length)
    length *= 2.0001 / BALL  # so that [-1, 1] falls into [0, BALL)
    column = (x / length + BALL / 2).astype(np.int64)
    row = (y / length + BALL / 2).astype(np.int64)
    row *= BALL
    row += column
    *skin, gloss = np.take(_BALL, row, axis=0).T
    light = np.empty_like(colours)
    for channel, reflected, colour in zip(light, skin, colours, strict=True):
        np.multiply(reflected, colour, out=channel)
        channel += gloss
        channel *= openness
    return light


def _lit_ball() -> Float32:
    """(BALL * BALL, 4): linear RGB on white skin and the highlight, by a normal's (y, x).

    Light depends on the normal alone, so it is computed once, on a ball.
    """
    along = (np.arange(BALL, dtype=np.float32) + 0.5) / BALL * 2 - 1
    x, y = np.tile(along, BALL), np.repeat(along, BALL)
    normals = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))])
    incident = LAMPS @ normals
    reached = np.maximum((incident[None] + WRAP[:, None, None]) / (1 + WRAP[:, None, None]), 0)
    lamps = np.einsum("lc,cln->cn", LAMP_COLOURS, reached)
    sky = GROUND[:, None] + (SKY - GROUND)[:, None] * (0.5 + 0.5 * y)
    gloss = GLOSS * np.maximum(HALF @ normals, 0) ** SHARPNESS
    sheen = SHEEN * (1 - normals[2]) ** 4 * np.maximum(incident[2] + 0.6, 0)
    light = np.concatenate([lamps + sky, (gloss + sheen)[None]])
    return np.ascontiguousarray(light.T, np.float32)


def background(size: int) -> Float32:
    """(3, size, size) linear: light grey behind the face, mid-grey at the edges."""
    along = (np.arange(size, dtype=np.float32) + 0.5) / size - 0.5
    away = np.sqrt(along[None] ** 2 + ((along + 0.12) * 0.9)[:, None] ** 2)
    grey = 0.60 - 0.46 * np.clip(away / 0.75, 0, 1) ** 1.3
    noise = np.random.default_rng(0).uniform(-0.5, 0.5, grey.shape)  # no bands after rounding
    tint = np.array([0.98, 1.0, 1.03], np.float32)
    return np.asarray((grey + noise * 0.004) * tint[:, None, None], np.float32)


def to_srgb(light: Float32) -> NDArray[np.uint8]:
    """Linear light to sRGB uint8 with a soft shoulder, any shape."""
    step = (light * np.float32(_STEPS / 2)).astype(np.int64)
    return np.asarray(np.take(_CURVE, step, mode="clip"))


def _curve() -> NDArray[np.uint8]:
    light = (np.arange(_STEPS) + 0.5) / (_STEPS / 2)
    knee = 0.72  # below, nothing changes; above, highlights run out softly
    over = np.maximum(light - knee, 0)
    light = np.where(light < knee, light, knee + (1 - knee) * (1 - np.exp(-over / (1 - knee))))
    srgb = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(255 * srgb), np.uint8)


_CURVE = _curve()
_BALL = _lit_ball()
