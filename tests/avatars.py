"""Avatars of several meshes to put speech onto, with names where exporters leave them."""

import io
import json
import struct

import numpy as np
from small_faces import ball

from facecode.writers.gltf.document import INDICES, VERTICES, Document, narrow
from facecode_exporter.head.face_units import FACE_UNITS

ARKIT = list(FACE_UNITS)
PLACES = ("mesh", "primitive", "target", "accessor", "nowhere")
"""Where the names of targets may be."""


class Motion:
    """Weights of ARKit's units, each another wave."""

    weight_names = tuple(ARKIT)

    def __init__(self, n_frames=5, fps=30.0):
        self.fps = fps
        waves = np.sin(np.arange(n_frames)[:, None] * 0.7 + np.arange(len(ARKIT)))
        self.weights = np.float32(0.5 + 0.5 * waves)

    def of(self, unit):
        return self.weights[:, ARKIT.index(unit)]


def avatar(meshes, place="mesh", **tables):
    """The JSON and the buffer of an avatar.

    Args:
        meshes: (name of a mesh, names of its targets); no name: no node shows the mesh.
        place: one of PLACES.
        tables: further entries of the JSON.
    """
    document = Document({"asset": {"version": "2.0", "generator": "a test"}, "scene": 0})
    document.add("scenes", nodes=[])
    vertices, faces = ball(6, 3)
    rng = np.random.default_rng(1)
    for name, targets in meshes:
        deltas = rng.standard_normal((len(targets), *vertices.shape)).astype(np.float32)
        rows = [{"POSITION": document.displacements(each)} for each in deltas]
        primitive = {
            "attributes": {"POSITION": document.accessor(vertices, target=VERTICES, bounds=True)},
            "indices": document.accessor(narrow(faces.ravel(), len(vertices)), target=INDICES),
            "targets": rows,
        }
        if place == "primitive":
            primitive["extras"] = {"targetNames": targets}
        for row, target in zip(rows, targets, strict=True):
            if place == "target":
                row["extras"] = {"name": target}
            if place == "accessor":
                document.tree["accessors"][row["POSITION"]]["name"] = target
        extras = {"targetNames": targets} if place == "mesh" else None
        mesh = document.add("meshes", name=name or "hidden", primitives=[primitive], extras=extras)
        if name:
            node = document.add("nodes", name=f"{name} node", mesh=mesh)
            document.tree["scenes"][0]["nodes"].append(node)
    document.tree |= tables
    document.tree["buffers"] = [{"byteLength": document.n_bytes}]
    return document.tree, b"".join(document.pieces)


def container(tree, binary=b"", further=(), text=None):
    """The bytes of a .glb."""
    text = json.dumps(tree, ensure_ascii=False).encode() if text is None else text
    text += b" " * (-len(text) % 4)
    chunks = [(b"JSON", text)]
    if binary:
        chunks.append((b"BIN\0", binary + b"\0" * (-len(binary) % 4)))
    body = b"".join(
        struct.pack("<I4s", len(data), kind) + data for kind, data in (*chunks, *further)
    )
    file = io.BytesIO()
    file.write(struct.pack("<4sII", b"glTF", 2, 12 + len(body)))
    file.write(body)
    return file.getvalue()
