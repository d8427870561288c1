"""The rig of a bundle as a file: `names` (K,) and `deltas` (K, V, 3) in a compressed .npz.

Trusts nobody: sizes are known from the headers before anything is unpacked.
"""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import BinaryIO, cast

import numpy as np

from facecode.arrays import AnyArray
from facecode.clip import Rig
from facecode.errors import ManifestError
from facecode.npy import read_array
from facecode.wording import one_line

MOST_UNITS = 1000
MOST_NAME_BYTES = 1 << 16
STAMP = (1980, 1, 1, 0, 0, 0)  # the earliest that a zip file can say: the same bytes every time


def read_rig(path: Path, names: tuple[str, ...], n_vertices: int) -> Rig:
    """Read and check the face units (K, V, 3) that a manifest names.

    Raises:
        ManifestError: not a rig, or one of other names or sizes.
    """
    if not 0 < len(names) <= MOST_UNITS or len(set(names)) != len(names) or "" in names:
        raise ManifestError(f"the rig names {len(names)} units; expected 1 to {MOST_UNITS}, unlike")
    try:
        with zipfile.ZipFile(path) as archive:
            most = len(names) * n_vertices * 12 + MOST_NAME_BYTES
            if sum(item.file_size for item in archive.infolist()) > most + MOST_NAME_BYTES:
                raise ManifestError(f"{path.name} unpacks to more than its {most:,} bytes")
            found, deltas = (_member(archive, name) for name in ("names", "deltas"))
    except Exception as error:  # broken archives raise whatever their readers stumble over
        if isinstance(error, ManifestError):
            raise
        raise ManifestError(
            f"{path.name} is not a rig of names and deltas: {one_line(error)}"
        ) from error
    _check(path.name, found, deltas, names, n_vertices)
    return Rig(names, deltas)


def _member(archive: zipfile.ZipFile, name: str) -> AnyArray:
    info = archive.getinfo(f"{name}.npy")
    with archive.open(info) as member:
        return read_array(cast(BinaryIO, member), info.file_size)


def _check(
    file: str, found: AnyArray, deltas: AnyArray, names: tuple[str, ...], n_vertices: int
) -> None:
    wanted = (len(names), n_vertices, 3)
    if deltas.shape != wanted or deltas.dtype != np.float32 or not np.isfinite(deltas).all():
        raise ManifestError(
            f"{file} holds deltas {deltas.dtype} {deltas.shape}; expected finite float32 {wanted}"
        )
    if found.dtype.kind != "U" or tuple(found.tolist()) != names:
        raise ManifestError(f"{file} holds other names than the manifest")


def write_rig(rig: Rig, file: BinaryIO) -> None:
    """Write a rig to an open binary file, compressed, the same bytes every time."""
    arrays = {"names": np.array(rig.names), "deltas": rig.deltas.astype(np.float32)}
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, array in arrays.items():
            buffer = io.BytesIO()
            np.save(buffer, array, allow_pickle=False)
            entry = zipfile.ZipInfo(f"{name}.npy", STAMP)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, buffer.getvalue())
