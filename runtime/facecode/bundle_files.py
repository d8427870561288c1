"""Files of a bundle, trusted only as far as they were checked: path, size, SHA-256, external data.

Knows nothing of what the arrays and graphs mean.
"""

from __future__ import annotations

import hashlib
from pathlib import Path, PurePosixPath

import numpy as np

from facecode.arrays import AnyArray
from facecode.errors import (
    AlteredFileError,
    ExternalDataError,
    ManifestError,
    MissingFileError,
    UnsafePathError,
)
from facecode.external_data import external_files
from facecode.npy import read_npy
from facecode_spec.entries import GraphEntry
from facecode_spec.manifest import Manifest


def verify_files(root: Path, manifest: Manifest) -> None:
    """Check every file that the manifest lists or uses, before anything is loaded from it.

    Raises:
        UnsafePathError, MissingFileError, AlteredFileError, ExternalDataError.
        ManifestError: a file that is used but not listed.
    """
    for name, entry in manifest.files.items():
        _verify(safe_path(root, name), name, entry.size, entry.sha256)
    _refuse_unlisted(manifest)
    for graph in manifest.graphs:
        _refuse_external_data(root, graph, manifest)


def safe_path(root: Path, name: str) -> Path:
    """`name` inside `root`, refused if it could lead anywhere else.

    Raises:
        UnsafePathError: absolute, with `..`, or through a linked folder. A file may be a link, as
            in caches of downloads: its size and hash are those of the manifest.
    """
    pure = PurePosixPath(name)
    if not name or pure.is_absolute() or ".." in pure.parts or "\\" in name or ":" in name:
        raise UnsafePathError(f"the manifest names {name!r}, which leaves the bundle {root}")
    folder = root
    for piece in pure.parts[:-1]:
        folder = folder / piece
        if folder.is_symlink():
            raise UnsafePathError(f"{folder} is a link to a folder; a bundle holds its own")
    return folder / pure.name


def load_array(root: Path, name: str, shape: tuple[int, ...], dtype: type[np.generic]) -> AnyArray:
    """The array in file `name`; -1 in `shape` is any size.

    Raises:
        ManifestError: not an array of that shape and dtype.
    """
    try:
        array = read_npy(safe_path(root, name))
    except (ValueError, OSError) as error:
        raise ManifestError(f"{name} is not a numpy array: {error}") from error
    fits = array.ndim == len(shape) and all(
        want in (-1, got) for want, got in zip(shape, array.shape, strict=True)
    )
    if not fits or array.dtype != dtype:
        raise ManifestError(
            f"{name} is {array.dtype} {array.shape}; the manifest asks for "
            f"{np.dtype(dtype)} {tuple('any' if s == -1 else s for s in shape)}"
        )
    return array


def load_optional_array(
    root: Path, name: str | None, shape: tuple[int, ...], dtype: type[np.generic]
) -> AnyArray | None:
    """As `load_array`; None where there is no file."""
    return None if name is None else load_array(root, name, shape, dtype)


def file_sha256(path: Path) -> str:
    """SHA-256 of a file's bytes, hexadecimal."""
    digest = hashlib.sha256()
    with path.open("rb") as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def _verify(file: Path, name: str, size: int, sha256: str) -> None:
    if not file.is_file():
        raise MissingFileError(f"{name} is missing from the bundle; copy or export it again")
    found = file.stat().st_size
    if found != size:
        raise AlteredFileError(
            f"{name} has {found} bytes, the manifest says {size}; copy or export it again"
        )
    if file_sha256(file) != sha256:
        raise AlteredFileError(
            f"{name} has changed since the export (its SHA-256 differs); copy or export it again"
        )


def _refuse_unlisted(manifest: Manifest) -> None:
    if unlisted := sorted(manifest.used_files - set(manifest.files)):
        raise ManifestError(f"the manifest uses {', '.join(unlisted)} but lists no size and hash")


def _refuse_external_data(root: Path, graph: GraphEntry, manifest: Manifest) -> None:
    try:
        locations = external_files(safe_path(root, graph.path))
    except ValueError as error:
        raise ManifestError(f"{graph.path} is not an ONNX file: {error}") from error
    folder = PurePosixPath(graph.path).parent
    for location in locations:
        if ".." in PurePosixPath(location).parts or str(folder / location) not in manifest.files:
            raise ExternalDataError(
                f"{graph.path} reads weights from {location!r}, which the manifest does not list"
            )
