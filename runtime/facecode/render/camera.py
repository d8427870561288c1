"""Where the face is seen from: framed once for a clip, so that only the face moves.

Comes in: vertices, y up and facing +z, in any unit. Goes out: screen positions. Knows nothing of
triangles or light.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Float32, Offsets, Template

TURN_DEG = 11.0  # a slight three-quarter view, which shows the nose and the jaw's depth
TILT_DEG = 4.0  # from a little above the eyes
DISTANCE = 4.5  # in heights of the head: a portrait lens
MARGIN = 0.07  # of the picture, on each side of the face
FRAMED = 24  # frames of the clip that the framing looks at


@dataclass(frozen=True)
class Camera:
    """A pinhole that looks along -z in its own axes."""

    rotation: Float32
    """(3, 3), from the face's axes to the camera's"""
    centre: Float32
    """(3,) in the face's axes: lands in the middle of the picture"""
    distance: float
    """from the pinhole to `centre`, in the face's unit"""
    scale: float
    """picture sides per (x / distance)"""

    @classmethod
    def framing(cls, template: Template, offsets: Offsets) -> Camera:
        """The view that holds the whole face over the clip, but for what is not finite."""
        rotation = _turned(TURN_DEG, TILT_DEG)
        seen = (offsets[spread(len(offsets), FRAMED)] + template).reshape(-1, 3)
        seen = seen[np.isfinite(seen).all(axis=1)]
        if not len(seen):
            seen = np.zeros((1, 3), np.float32)
        turned = seen @ rotation.T
        middle = (turned.min(axis=0) + turned.max(axis=0)) / 2
        extent = float(np.ptp(turned, axis=0).max()) or 1.0
        distance = DISTANCE * extent
        flat = np.abs((turned - middle)[:, :2]) / (distance - (turned - middle)[:, 2:])
        scale = (0.5 - MARGIN) / max(float(flat.max()), 1e-6)
        return cls(rotation, (middle @ rotation).astype(np.float32), distance, scale)

    def project(self, vertices: Template, size: int) -> Float32:
        """(V, 3) to (3, V): x to the right and y down in a square picture, and 1 / distance."""
        seen = (vertices - self.centre) @ self.rotation.T
        near = 1 / (self.distance - seen[:, 2])
        zoom = self.scale * size * near
        return np.stack([size / 2 + seen[:, 0] * zoom, size / 2 - seen[:, 1] * zoom, near]).astype(
            np.float32
        )


def spread(n_frames: int, n: int) -> NDArray[np.int64]:
    """At most `n` frames, evenly over a clip, the first and the last among them."""
    return np.unique(np.linspace(0, n_frames - 1, n).astype(np.int64))


def _turned(turn_deg: float, tilt_deg: float) -> Float32:
    turn, tilt = np.deg2rad([turn_deg, tilt_deg])
    about_y = [[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]]
    about_x = [[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]]
    return (np.array(about_x) @ np.array(about_y)).astype(np.float32)
