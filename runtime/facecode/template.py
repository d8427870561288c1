"""A neutral face of the user's own, from a mesh file or an array."""

from __future__ import annotations

import itertools
import os
from pathlib import Path
from typing import TypeAlias

import numpy as np

from facecode.arrays import AnyArray, Faces, Template
from facecode.errors import TemplateError
from facecode.npy import read_npy

TemplateSource: TypeAlias = "str | os.PathLike[str] | AnyArray"

LARGEST_RATIO, LARGEST_TURN, LEAST_AGREEMENT = 3.0, 45.0, 0.7
"""Of sizes; degrees; correlation of vertices after the best rotation, about 1 for any two heads."""


def load_template(source: TemplateSource, n_vertices: int) -> Template:
    """Vertices (V, 3) float32 with the bundle's topology.

    Args:
        source: .npy of shape (V, 3), .ply, .obj, or an array.
        n_vertices: V of the bundle.

    Raises:
        TemplateError: unreadable, or another number of vertices.
    """
    vertices = source if isinstance(source, np.ndarray) else read_mesh(Path(source))[0]
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise TemplateError(f"template has shape {vertices.shape}; expected ({n_vertices}, 3)")
    if len(vertices) != n_vertices:
        raise TemplateError(
            f"template has {len(vertices):,} vertices; this bundle animates {n_vertices:,}. "
            "Export the mesh in the bundle's topology, without re-ordering or merging"
        )
    if not np.issubdtype(vertices.dtype, np.number) or not np.isfinite(vertices).all():
        raise TemplateError("template holds values that are not finite numbers")
    return np.ascontiguousarray(vertices, dtype=np.float32)


def check_fit(template: Template, own: Template, unit: str) -> None:
    """Refuse a template that cannot be this head: of another unit, axes or order of vertices.

    Compared with the bundle's own face by size and by the rotation that fits best (Kabsch 1976);
    heads of any shape that people have pass.

    Args:
        template: (V, 3).
        own: (V, 3) of the bundle.
        unit: of the bundle, for messages.

    Raises:
        TemplateError
    """
    centred, mine = (each - each.mean(axis=0, dtype=np.float64) for each in (template, own))
    size, expected = float(np.linalg.norm(centred)), float(np.linalg.norm(mine))
    if not expected:  # a bundle whose own face is no face
        return
    ratio = size / expected if np.isfinite(size) else np.inf
    if not 1 / LARGEST_RATIO <= ratio <= LARGEST_RATIO:
        raise TemplateError(
            f"the template is {ratio:.3g} times as large as the bundle's own face, whose unit is "
            f"{unit}; bring it to that unit"
        )
    left, agreement, right = np.linalg.svd(mine.T @ centred / (size * expected))
    if agreement.sum() < LEAST_AGREEMENT:
        raise TemplateError(
            "the template's vertices lie elsewhere than those of the bundle's own face; export the "
            "mesh without re-ordering or merging vertices"
        )
    rotation = left @ right
    if np.linalg.det(rotation) < 0:
        raise TemplateError("the template is mirrored; turn one of its axes round")
    angle = np.degrees(np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1, 1)))
    if angle > LARGEST_TURN:
        raise TemplateError(
            f"the template is turned by {angle:.0f} degrees against the bundle's own face; export "
            "the mesh with the bundle's up axis"
        )


def read_mesh(path: Path) -> tuple[AnyArray, Faces | None]:
    """Vertices (V, 3) in file order and faces (F, 3), or None where the file has none.

    Raises:
        TemplateError: missing or unreadable.
    """
    if not path.is_file():
        raise TemplateError(f"no template file at {path}")
    suffix = path.suffix.lower()
    if suffix not in (".npy", ".ply", ".obj"):
        raise TemplateError(f"template {path} has an unknown type; expected .npy, .ply or .obj")
    try:
        if suffix == ".npy":
            return read_npy(path), None
        if suffix == ".obj":
            return _read_obj(path.read_text(encoding="utf-8", errors="replace"))
        return _read_ply(path)
    except Exception as error:  # parsers of broken files raise whatever they stumble over
        raise TemplateError(f"template {path} cannot be read: {error}") from error


def _read_ply(path: Path) -> tuple[AnyArray, Faces | None]:
    import trimesh

    # In the order of the file, and without the pictures that it names, wherever they lie.
    with path.open("rb") as file:
        mesh = trimesh.load(
            file, file_type="ply", process=False, fix_texture=False, skip_materials=True
        )
    faces = np.asarray(getattr(mesh, "faces", ()), dtype=np.int32)
    return np.asarray(mesh.vertices), faces if faces.size else None


def _read_obj(text: str) -> tuple[AnyArray, Faces | None]:
    """Positions and triangles in file order.

    Not by trimesh, which splits vertices along texture seams and drops those without a face:
    a template's order is its meaning.
    """
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    for line in text.splitlines():
        kind, *values = line.split() or [""]
        if kind == "v":
            vertices.append([float(v) for v in values[:3]])
        elif kind == "f":
            numbers = [int(v.partition("/")[0]) for v in values]
            corners = [n - 1 if n > 0 else len(vertices) + n for n in numbers]
            faces += [[corners[0], b, c] for b, c in itertools.pairwise(corners[1:])]
    return np.array(vertices), np.array(faces, dtype=np.int32) if faces else None
