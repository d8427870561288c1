"""The neutral face as a mesh: .obj, .ply or .glb, vertices in the order of every other output.

Comes in: a clip, whose frames do not matter. Goes out: the mesh that point caches move (.obj), in
metres, y up, with colours where they are known; .glb also has the units of the rig as shapes.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from facecode import writers
from facecode.clip import Clip
from facecode.errors import NoFacesError, OutputSuffixError
from facecode.writers.glb import document_of
from facecode.writers.space import metres_y_up

DIGITS = 12
"""Decimals in an .obj: a thousand-millionth of a millimetre."""
SUFFIXES = (".obj", ".ply", ".glb")


def check_mesh(path: Path) -> None:
    """Refuse a file name of another kind, or in a folder that is missing.

    Raises:
        OutputSuffixError, OutputFolderError, OutputWriteError.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise OutputSuffixError(
            f"cannot write {path.name!r}: the suffix is {path.suffix!r}; expected one of "
            f"{', '.join(SUFFIXES)}"
        )
    writers.check_folder(path)


def save_mesh(still: Clip, path: Path) -> None:
    """Write the neutral face of a clip of no frame; whole or not at all.

    Raises:
        NoFacesError: the clip has no triangles.
        OutputSuffixError, OutputFolderError, OutputWriteError.
    """
    check_mesh(path)
    suffix = path.suffix.lower()
    if still.faces is None:
        raise NoFacesError.to_write(suffix)
    content = io.BytesIO()
    if suffix == ".glb":
        document_of([still]).write(content)
    else:
        content.write(_of_trimesh(still, suffix))
    with writers.writing(path) as file:
        file.write(content.getvalue())


def _of_trimesh(still: Clip, suffix: str) -> bytes:
    import trimesh

    mesh = trimesh.Trimesh(
        metres_y_up(still, still.template),
        still.faces,
        vertex_colors=None if still.colours is None else np.asarray(still.colours),
        process=False,  # merges and reorders vertices
    )
    if suffix == ".ply":
        data: bytes = mesh.export(file_type="ply")
        return data
    text: str = mesh.export(
        file_type="obj", digits=DIGITS, include_normals=False, header="The neutral face of facecode"
    )
    return text.encode()
