"""A neutral face of the user's own, from a mesh file or an array."""

from __future__ import annotations

import io
import os
import re
from pathlib import Path
from typing import TypeAlias

import numpy as np

from facecode.arrays import AnyArray, Faces, Template
from facecode.errors import TemplateError

TemplateSource: TypeAlias = "str | os.PathLike[str] | AnyArray"


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
            return np.load(path, allow_pickle=False), None
        import trimesh

        data = path.read_bytes()
        content = _plain_obj(data) if suffix == ".obj" else data
        mesh = trimesh.load(io.BytesIO(content), file_type=suffix[1:], process=False)
        vertices = np.asarray(mesh.vertices)
        faces = getattr(mesh, "faces", None)
    except Exception as error:  # parsers of broken files raise whatever they stumble over
        raise TemplateError(f"template {path} cannot be read: {error}") from error
    if faces is None or len(faces) == 0:
        return vertices, None
    return vertices, np.ascontiguousarray(faces, dtype=np.int32)


def _plain_obj(data: bytes) -> bytes:
    """Positions and faces only: a reader that sees texture seams splits vertices along them."""
    lines = []
    for line in data.decode("utf-8", "replace").splitlines():
        if line.startswith("v "):
            lines.append(line)
        elif line.startswith("f "):
            lines.append(re.sub(r"/\S*", "", line))
    return "\n".join(lines).encode()
