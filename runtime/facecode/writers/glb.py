"""A head for Blender, three.js, Unity, Unreal, Godot: a .glb (glTF 2.0) with morph targets.

Comes in: a clip with faces, or several. Goes out: a mesh with normals and colours, in metres and
y up, whose shapes are the units of the rig under their names, and an animation of their weights.
Without a rig the shapes are components of the motion itself, as many as TOLERANCE_MM asks for. A
clip of no frame is a head without animation.
The sound is not in it: glTF has no place for it. Knows nothing of bytes (`gltf/` does).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, BinaryIO

import numpy as np

from facecode.clip import Clip
from facecode.writers.format import Format, gathered
from facecode.writers.gltf.animation import add_animation
from facecode.writers.gltf.document import INDICES, VERTICES, Document, narrow
from facecode.writers.shapes import Shapes, places, shapes_of, surface_of

ANIMATION = "facecode"
ROUGHNESS = 0.6  # of skin: a broad, weak highlight


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
    shapes = shapes_of(clips)
    from importlib.metadata import version

    asset = {"version": "2.0", "generator": f"facecode {version('facecode')}"}
    extras = {"fps": clips[0].fps, **shapes.notes}
    document = Document({"asset": asset | {"extras": extras}, "scene": 0})
    document.add("scenes", name="facecode", nodes=list(range(len(clips))))
    material = document.add("materials", **_material(clips[0]))
    channels = []
    for index, (clip, x) in enumerate(zip(clips, places(clips), strict=True)):
        name = "face" if len(clips) == 1 else f"face_{index + 1}"
        mesh = _add_mesh(document, name, clip, shapes, material)
        node = document.add("nodes", name=name, mesh=mesh, translation=[x, 0, 0] if x else None)
        channels.append((node, "weights", shapes.weights[index]))
    if clips[0].n_frames:
        add_animation(document, ANIMATION, clips[0].fps, channels)
    return document


def _add_mesh(document: Document, name: str, clip: Clip, shapes: Shapes, material: int) -> int:
    template, faces, normals = surface_of(clip, ".glb")
    attributes = {
        "POSITION": document.accessor(template + shapes.rest, target=VERTICES, bounds=True),
        "NORMAL": document.accessor(normals, target=VERTICES),
    }
    if clip.colours is not None:
        colours = _linear_16_bit(clip.colours)
        attributes["COLOR_0"] = document.accessor(colours, target=VERTICES, normalized=True)
    indices = narrow(faces.ravel(), len(template))
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


GLB = Format(
    ".glb", write_glb, write_takes_glb, write_blocks_glb, needs_faces=True, needs_vertices=False
)
