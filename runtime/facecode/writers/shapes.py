"""The surface of a face and the shapes that move it, for formats that hold weights.

Comes in: clips of one face. Goes out: points in metres, y up, triangles, normals, and shapes with
their weights: the units of the rig, or without one components of the motion, as many as
TOLERANCE_MM asks for. Knows nothing of files.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from facecode.arrays import Faces, Float32
from facecode.clip import Clip
from facecode.errors import NoFacesError
from facecode.writers.components import components_of
from facecode.writers.space import metres_per_unit, metres_y_up

TOLERANCE_MM = 0.1
"""The greatest error of a vertex without a rig: 17 shapes for the packaged sentence."""
UNKNOWN_TOLERANCE = 5e-4
"""The same where the unit is not known, as a share of the head's height (0.1 mm of 20 cm)."""
APART = 1.3  # widths of a head from one face to the next


@dataclass(frozen=True)
class Shapes:
    """What moves a face: K shapes in metres, y up, and the weights of each clip."""

    names: tuple[str, ...]
    rest: Float32
    """(V, 3) displacement of the template where all weights are 0."""
    deltas: Float32
    """(K, V, 3)"""
    weights: tuple[Float32, ...]
    """(T, K) for each clip"""
    at_rest: list[float]
    """(K,) weights of the mesh while nothing plays"""
    notes: dict[str, Any] = field(default_factory=dict)
    """What is said of them in the file."""


def shapes_of(clips: Sequence[Clip]) -> Shapes:
    """The units of the rig of clips of one face, or components of their motion without one."""
    return _units(clips) if clips[0].rig is not None else _components(clips)


def surface_of(clip: Clip, suffix: str) -> tuple[Float32, Faces, Float32]:
    """The template (V, 3) in metres, its triangles seen from outside, and normals (V, 3).

    Triangles with a corner twice are left out.

    Raises:
        NoFacesError: the clip has no triangles; the message names the format's suffix.
    """
    if clip.faces is None:
        raise NoFacesError.to_write(suffix)
    from facecode.render.surface import outward, vertex_normals

    template = metres_y_up(clip, clip.template)
    faces = outward(template, clip.faces)
    normals = vertex_normals(template, faces)
    normals[~normals.any(axis=1)] = 0, 0, 1  # of vertices without a triangle
    distinct = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return template, faces[distinct], normals


def places(clips: Sequence[Clip]) -> list[float]:
    """Where each face stands along x, in metres, so that they are side by side."""
    width = float(np.ptp(metres_y_up(clips[0], clips[0].template)[:, 0]))
    along = (np.arange(len(clips)) - (len(clips) - 1) / 2) * APART * width
    found: list[float] = along.tolist()
    return found


def _units(clips: Sequence[Clip]) -> Shapes:
    first, rig = clips[0], clips[0].rig
    assert rig is not None
    weights = tuple(np.asarray(clip.weights, np.float32) for clip in clips)
    deltas = metres_y_up(first, rig.deltas)
    rest = np.zeros_like(first.template)
    return Shapes(rig.names, rest, deltas, weights, [0.0] * len(rig.names))


def _components(clips: Sequence[Clip]) -> Shapes:
    first = clips[0]
    if not first.n_frames:
        none = np.zeros((0, *first.template.shape), np.float32)
        weights = tuple(np.zeros((0, 0), np.float32) for _ in clips)
        return Shapes((), np.zeros_like(first.template), none, weights, [])
    height = float(np.ptp(first.template, axis=0).max())
    known = first.metres_per_unit is not None
    per_mm = 1000 * metres_per_unit(first)
    tolerance = TOLERANCE_MM / per_mm if known else UNKNOWN_TOLERANCE * height
    found = components_of([clip.offsets for clip in clips], tolerance)
    names = tuple(f"component_{index + 1:02d}" for index in range(len(found.shapes)))
    notes: dict[str, Any] = {"components": len(names)}
    if known:
        notes |= {"tolerance_mm": TOLERANCE_MM, "greatest_error_mm": found.error * per_mm}
    else:
        notes |= {"tolerance": tolerance, "greatest_error": found.error}
    rest, deltas = metres_y_up(first, found.rest), metres_y_up(first, found.shapes)
    at_rest = found.weights[0][0].tolist()  # with all at 0 the face is no face
    return Shapes(names, rest, deltas, found.weights, at_rest, notes)
