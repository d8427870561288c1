"""A head for Blender, three.js, Unity, Unreal, Godot: a .glb (glTF 2.0) with morph targets.

Comes in: a clip with faces, or several. Goes out: a mesh with normals and colours, in metres and
y up, whose shapes are the units of the rig under their names, and an animation of their weights.
Without a rig the shapes are components of the motion itself, as many as TOLERANCE_MM asks for. A
clip of no frame is a head without animation.
The sound is not in it: glTF has no place for it. Knows nothing of bytes (`gltf/` does).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, BinaryIO

import numpy as np

from facecode.arrays import Float32
from facecode.clip import Clip
from facecode.errors import NoFacesError
from facecode.writers.components import components_of
from facecode.writers.format import Format, gathered
from facecode.writers.gltf.animation import add_animation
from facecode.writers.gltf.document import INDICES, VERTICES, Document, narrow
from facecode.writers.space import metres_per_unit, metres_y_up

TOLERANCE_MM = 0.1
"""The greatest error of a vertex without a rig: 17 shapes for the packaged sentence."""
UNKNOWN_TOLERANCE = 5e-4
"""The same where the unit is not known, as a share of the head's height (0.1 mm of 20 cm)."""
APART = 1.3  # widths of a head from one face to the next
ANIMATION = "facecode"
ROUGHNESS = 0.6  # of skin: a broad, weak highlight


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


def write_glb(clip: Clip, file: BinaryIO, progress: bool = False) -> None:  # noqa: ARG001
    """Write a clip to an open binary file; too quick for `progress`.

    Raises:
        NoFacesError: the clip has no triangles.
        OutputWriteError: over 4 GiB.
    """
    document_of([clip]).write(file)


def write_blocks_glb(face: Clip, n_frames: int, blocks: Iterable[Clip], file: BinaryIO) -> None:
    """Write a clip that comes in blocks; with a rig only its weights are held.

    Raises:
        NoFacesError: the clip has no triangles.
        OutputWriteError: over 4 GiB.
    """
    del n_frames
    write_glb(gathered(face, blocks), file)


def write_takes_glb(clips: Sequence[Clip], file: BinaryIO, progress: bool = False) -> None:  # noqa: ARG001
    """Write faces side by side, APART, each a node of its own, moved by one animation.

    Raises:
        NoFacesError: a clip has no triangles.
        OutputWriteError: over 4 GiB.
    """
    document_of(clips).write(file)


def document_of(clips: Sequence[Clip]) -> Document:
    """The glTF of clips of one face: meshes, nodes, a scene and an animation.

    Raises:
        NoFacesError: a clip has no triangles.
    """
    shapes = _units(clips) if clips[0].rig is not None else _components(clips)
    from importlib.metadata import version

    asset = {"version": "2.0", "generator": f"facecode {version('facecode')}"}
    extras = {"fps": clips[0].fps, **shapes.notes}
    document = Document({"asset": asset | {"extras": extras}, "scene": 0})
    document.add("scenes", name="facecode", nodes=list(range(len(clips))))
    material = document.add("materials", **_material(clips[0]))
    places = (np.arange(len(clips)) - (len(clips) - 1) / 2) * APART * _width(clips[0])
    channels = []
    for index, (clip, x) in enumerate(zip(clips, places.tolist(), strict=True)):
        name = "face" if len(clips) == 1 else f"face_{index + 1}"
        mesh = _add_mesh(document, name, clip, shapes, material)
        node = document.add("nodes", name=name, mesh=mesh, translation=[x, 0, 0] if x else None)
        channels.append((node, "weights", shapes.weights[index]))
    if clips[0].n_frames:
        add_animation(document, ANIMATION, clips[0].fps, channels)
    return document


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


def _add_mesh(document: Document, name: str, clip: Clip, shapes: Shapes, material: int) -> int:
    if clip.faces is None:
        raise NoFacesError.to_write(".glb")
    from facecode.render.surface import outward, vertex_normals

    template = metres_y_up(clip, clip.template)
    faces = outward(template, clip.faces)
    normals = vertex_normals(template, faces)
    normals[~normals.any(axis=1)] = 0, 0, 1  # of vertices without a triangle
    attributes = {
        "POSITION": document.accessor(template + shapes.rest, target=VERTICES, bounds=True),
        "NORMAL": document.accessor(normals, target=VERTICES),
    }
    if clip.colours is not None:
        colours = _linear_16_bit(clip.colours)
        attributes["COLOR_0"] = document.accessor(colours, target=VERTICES, normalized=True)
    distinct = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    indices = narrow(faces[distinct].ravel(), len(template))
    primitive = {
        "attributes": attributes,
        "indices": document.accessor(indices, target=INDICES),
        "material": material,
    }
    if not shapes.names:
        return document.add("meshes", name=name, primitives=[primitive])
    targets = [{"POSITION": document.displacements(each)} for each in shapes.deltas]
    return document.add(
        "meshes",
        name=name,
        primitives=[primitive | {"targets": targets}],
        weights=shapes.at_rest,
        extras={"targetNames": list(shapes.names)},
    )


def _material(clip: Clip) -> dict[str, Any]:
    from facecode.render import light

    surface: dict[str, Any] = {"metallicFactor": 0, "roughnessFactor": ROUGHNESS}
    if clip.colours is None:
        clay = light.linear(np.array(light.CLAY, np.uint8)).round(4).tolist()
        surface["baseColorFactor"] = [*clay, 1]
    return {"name": "skin", "pbrMetallicRoughness": surface, "doubleSided": True}


def _linear_16_bit(colours: Any) -> Any:  # noqa: ANN401
    """(V, 4) uint16 linear RGB and alpha: 8 bits would band in the dark."""
    from facecode.render import light

    rgb = np.rint(light.linear(colours) * 65535)
    opaque = np.full((len(rgb), 1), 65535)
    return np.concatenate([rgb, opaque], axis=1).astype(np.uint16)


def _width(clip: Clip) -> float:
    return float(np.ptp(metres_y_up(clip, clip.template)[:, 0]))


GLB = Format(
    ".glb", write_glb, write_takes_glb, write_blocks_glb, needs_faces=True, needs_vertices=False
)
