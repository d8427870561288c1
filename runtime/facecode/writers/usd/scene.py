"""A scene of heads as the text of a USD layer.

Comes in: clips of one face. Goes out: an Xform with a head for each clip, in metres, y up, one
time code a frame. With shapes a head is a SkelRoot: blend shapes, a skeleton of one joint (UsdSkel
asks for one) and an animation of the weights. Without, it is a mesh at rest.
Knows nothing of archives, and needs no library.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facecode.arrays import Float32
from facecode.clip import Clip
from facecode.writers.shapes import Shapes, places, surface_of
from facecode.writers.usd.text import identifiers, numbers, prim, quoted, tokens, vectors

ROOT = "facecode"
ROUGHNESS = 0.6  # of skin: a broad, weak highlight
SHORT = "%.6g"
"""Of displacements and weights: 1e-5 mm of 20 mm."""
IDENTITY = "((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1))"


def head_names(n_faces: int) -> list[str]:
    """Names of the heads; the mesh of a head is its child `NAME_mesh`."""
    return ["face"] if n_faces == 1 else [f"face_{index + 1}" for index in range(n_faces)]


def mesh_path(name: str) -> str:
    """Where the mesh of a head is."""
    return f"/{ROOT}/{name}/{name}_mesh"


def scene(
    clips: Sequence[Clip], suffix: str, shapes: Shapes | None, sound: str | None = None
) -> str:
    """The layer.

    Args:
        clips: of one face, rate and length.
        suffix: of the format, for messages.
        shapes: what moves the faces; None: they rest.
        sound: the speech's file beside the layer.

    Raises:
        NoFacesError: a clip has no triangles.
    """
    from importlib.metadata import version

    made_by = f"facecode {version('facecode')}"
    children: list[str] = []
    for index, (name, x) in enumerate(zip(head_names(len(clips)), places(clips), strict=True)):
        lines = _mesh(clips[index], name, suffix, shapes)
        metadata = []
        if shapes is not None:
            lines = [*_extent(clips[index], shapes), *lines, *_skeleton(name, shapes, index)]
            metadata = ['prepend apiSchemas = ["SkelBindingAPI"]']
        moved = [
            f"double3 xformOp:translate = ({x:.9g}, 0, 0)",
            'uniform token[] xformOpOrder = ["xformOp:translate"]',
        ]
        children += prim("SkelRoot" if shapes else "Xform", name, [*moved, *lines], metadata)
    children += _material()
    if sound is not None:
        children += _speech(sound)
    rate = repr(float(clips[0].fps))
    layer = [
        f"doc = {quoted(made_by)}",
        f'defaultPrim = "{ROOT}"',
        f"endTimeCode = {max(clips[0].n_frames - 1, 0)}",
        f"framesPerSecond = {rate}",
        "metersPerUnit = 1",
        "startTimeCode = 0",
        f"timeCodesPerSecond = {rate}",
        'upAxis = "Y"',
    ]
    root = prim("Xform", ROOT, children, ['kind = "component"'])
    return "\n".join(["#usda 1.0", "(", *(f"    {line}" for line in layer), ")", "", *root, ""])


def _mesh(clip: Clip, name: str, suffix: str, shapes: Shapes | None) -> list[str]:
    template, faces, normals = surface_of(clip, suffix)
    points = template if shapes is None else template + shapes.rest
    bounds = np.stack([points.min(axis=0), points.max(axis=0)])
    lines = [
        "uniform bool doubleSided = 1",
        f"float3[] extent = {vectors(bounds)}",
        f"int[] faceVertexCounts = {numbers(np.full(len(faces), 3), '%d')}",
        f"int[] faceVertexIndices = {numbers(faces, '%d')}",
        f"point3f[] points = {vectors(points)}",
        f'normal3f[] normals = {vectors(normals, SHORT)} (interpolation = "vertex")',
        'uniform token subdivisionScheme = "none"',
        f"rel material:binding = </{ROOT}/skin>",
        *_colours(clip),
    ]
    schemas = ["MaterialBindingAPI"]
    if shapes is not None:
        lines += _binding(name, shapes)
        schemas.append("SkelBindingAPI")
    return prim("Mesh", f"{name}_mesh", lines, [f"prepend apiSchemas = {tokens(schemas)}"])


def _colours(clip: Clip) -> list[str]:
    from facecode.render import light

    if clip.colours is None:
        clay = light.linear(np.array([light.CLAY], np.uint8))
        values, spread = vectors(clay, SHORT), "constant"
    else:
        values, spread = vectors(light.linear(clip.colours), SHORT), "vertex"
    return [f'color3f[] primvars:displayColor = {values} (interpolation = "{spread}")']


def _binding(name: str, shapes: Shapes) -> list[str]:
    """The shapes of a mesh, and the joint that it hangs from."""
    names = identifiers(shapes.names)
    one = '(elementSize = 1; interpolation = "constant")'
    lines = [
        f"matrix4d primvars:skel:geomBindTransform = {IDENTITY}",
        f"int[] primvars:skel:jointIndices = [0] {one}",
        f"float[] primvars:skel:jointWeights = [1] {one}",
        f"rel skel:skeleton = </{ROOT}/{name}/skeleton>",
    ]
    if names:
        targets = ", ".join(f"<{mesh_path(name)}/{each}>" for each in names)
        lines += [
            f"uniform token[] skel:blendShapes = {tokens(shapes.names)}",
            f"rel skel:blendShapeTargets = [{targets}]",
        ]
    for each, delta in zip(names, shapes.deltas, strict=True):
        lines += prim("BlendShape", each, _shape(delta))
    return lines


def _shape(delta: Float32) -> list[str]:
    moved = np.flatnonzero(delta.any(axis=1))
    moved = moved if len(moved) else np.zeros(1, np.int64)  # readers drop a shape of no point
    return [
        f"uniform vector3f[] offsets = {vectors(delta[moved], SHORT)}",
        f"uniform int[] pointIndices = {numbers(moved, '%d')}",
    ]


def _skeleton(name: str, shapes: Shapes, index: int) -> list[str]:
    lines = [
        'uniform token[] joints = ["root"]',
        f"uniform matrix4d[] bindTransforms = [{IDENTITY}]",
        f"uniform matrix4d[] restTransforms = [{IDENTITY}]",
        f"rel skel:animationSource = </{ROOT}/{name}/skeleton/animation>",
    ]
    weights = shapes.weights[index]
    animation = [
        'uniform token[] joints = ["root"]',
        "float3[] translations = [(0, 0, 0)]",
        "quatf[] rotations = [(1, 0, 0, 0)]",
        "half3[] scales = [(1, 1, 1)]",
    ]
    if len(weights):
        samples = [f"    {frame}: {numbers(row, SHORT)}," for frame, row in enumerate(weights)]
        animation += [
            f"uniform token[] blendShapes = {tokens(shapes.names)}",
            "float[] blendShapeWeights.timeSamples = {",
            *samples,
            "}",
        ]
    lines += prim("SkelAnimation", "animation", animation)
    schema = ['prepend apiSchemas = ["SkelBindingAPI"]']
    return prim("Skeleton", "skeleton", lines, schema)


def _extent(clip: Clip, shapes: Shapes) -> list[str]:
    """A box that holds the face in every frame: no vertex goes beyond the sum of its shapes."""
    points = surface_of(clip, "")[0] + shapes.rest
    reach = [weights.max(axis=0) for weights in shapes.weights if weights.size]
    most = np.max(reach, axis=0) if reach else np.zeros(len(shapes.names))
    low = points + np.tensordot(most, np.minimum(shapes.deltas, 0), 1)
    high = points + np.tensordot(most, np.maximum(shapes.deltas, 0), 1)
    return [f"float3[] extent = {vectors(np.stack([low.min(axis=0), high.max(axis=0)]))}"]


def _material() -> list[str]:
    """Skin whose colour is the mesh's `displayColor`, for renderers that look at materials only."""
    path = f"/{ROOT}/skin"
    surface = [
        'uniform token info:id = "UsdPreviewSurface"',
        f"color3f inputs:diffuseColor.connect = <{path}/colour.outputs:result>",
        f"float inputs:roughness = {ROUGHNESS}",
        "token outputs:surface",
    ]
    colour = [
        'uniform token info:id = "UsdPrimvarReader_float3"',
        'string inputs:varname = "displayColor"',
        "float3 outputs:result",
    ]
    lines = [
        f"token outputs:surface.connect = <{path}/surface.outputs:surface>",
        *prim("Shader", "surface", surface),
        *prim("Shader", "colour", colour),
    ]
    return prim("Material", "skin", lines)


def _speech(sound: str) -> list[str]:
    lines = [
        'uniform token auralMode = "nonSpatial"',
        f"uniform asset filePath = @{sound}@",
        'uniform token playbackMode = "onceFromStart"',
        "uniform timecode startTime = 0",
    ]
    return prim("SpatialAudio", "speech", lines)
