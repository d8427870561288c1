"""Open and verify a bundle: a folder with manifest.json, graphs and arrays.

Every file that the manifest lists is checked (path, size, SHA-256, external data) before anything
is loaded from it. Knows nothing of onnxruntime.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from facecode.arrays import AnyArray, Colours, Faces, Indices, Template
from facecode.errors import (
    AlteredFileError,
    BundleNotFoundError,
    ExternalDataError,
    ManifestError,
    MissingFileError,
    NewerBundleError,
    UnsafePathError,
)
from facecode.external_data import external_files
from facecode_spec.manifest import (
    MANIFEST_NAME,
    GraphEntry,
    Manifest,
    NewerFormatError,
    PartEntry,
)
from facecode_spec.schema import SpecError

_ASSETS = Path(__file__).parent / "assets"
PACKAGED_BUNDLE = _ASSETS / "demo"
PACKAGED = {"demo": PACKAGED_BUNDLE, "diverse": _ASSETS / "diverse"}
"""Bundles that come with facecode, by the names that stand for them."""


@dataclass(frozen=True)
class Bundle:
    """A verified bundle: its folder and manifest, with the arrays that belong to the face."""

    root: Path
    manifest: Manifest
    template: Template
    faces: Faces | None
    colours: Colours | None

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Bundle:
        """Read the manifest at `path` and verify every file that it lists.

        Args:
            path: a folder, or the name of a packaged bundle where no folder has that name.

        Raises:
            BundleNotFoundError, ManifestError, NewerBundleError, UnsafePathError,
            MissingFileError, AlteredFileError, ExternalDataError.
        """
        root = Path(path)
        if not root.exists():
            root = PACKAGED.get(os.fspath(path), root)
        manifest = read_manifest(root)
        for name, entry in manifest.files.items():
            file = safe_path(root, name)
            _verify(file, name, entry.size, entry.sha256)
        _refuse_unlisted(manifest)
        for graph in graph_entries(manifest):
            _refuse_external_data(root, graph, manifest)
        template = load_array(root, manifest.template, (manifest.n_vertices, 3), np.float32)
        faces = _optional_array(root, manifest.faces, (-1, 3), np.int32)
        colours = _optional_array(root, manifest.colours, (manifest.n_vertices, 3), np.uint8)
        bundle = cls(root, manifest, template, faces, colours)
        bundle._check_parts()
        return bundle

    def _check_parts(self) -> None:
        """Refuse parts that leave a vertex out, or move it twice."""
        everything = np.arange(self.manifest.n_vertices)
        parts = [self.part_vertices(part) for part in self.manifest.parts]
        moved = np.concatenate([everything if p is None else p for p in parts])
        if not np.array_equal(np.sort(moved), everything):
            raise ManifestError(
                f"the parts of {self.root} do not move every vertex once ({len(moved)} indices "
                f"for {len(everything)} vertices); export it again"
            )

    def region(self, name: str) -> Indices:
        """Vertex indices (n,) of a region that the manifest names.

        Raises:
            ManifestError
        """
        return load_array(self.root, self.manifest.regions[name], (-1,), np.int32)

    def identity(self, name: str) -> Template:
        """The neutral face (V, 3) of an identity that the manifest names.

        Raises:
            ManifestError
        """
        file = self.manifest.identities[name]
        return load_array(self.root, file, (self.manifest.n_vertices, 3), np.float32)

    def part_vertices(self, part: PartEntry) -> Indices | None:
        """Vertex indices (n,) of a part of the face; None: it moves all.

        Raises:
            ManifestError
        """
        if part.vertices is None:
            return None
        return load_array(self.root, part.vertices, (-1,), np.int32)

    def path(self, name: str) -> Path:
        """Where the file `name` of the manifest lies."""
        return safe_path(self.root, name)


def read_manifest(root: Path) -> Manifest:
    """The manifest of the bundle at `root`.

    Raises:
        BundleNotFoundError, ManifestError, NewerBundleError.
    """
    file = root / MANIFEST_NAME
    if not file.is_file():
        if root == PACKAGED_BUNDLE:
            raise BundleNotFoundError(
                "this release packages no model yet; name a bundle folder, made with "
                "'facecode-export export'"
            )
        reason = "the folder does not exist" if not root.is_dir() else f"it has no {MANIFEST_NAME}"
        raise BundleNotFoundError(
            f"no bundle at {root}: {reason}. Make one with 'facecode-export export'"
        )
    try:
        return Manifest.from_json(file.read_text(encoding="utf-8"))
    except NewerFormatError as error:
        raise NewerBundleError(f"{root}: {error}. Upgrade facecode, or export again") from error
    except (SpecError, UnicodeDecodeError) as error:
        raise ManifestError(f"{file} cannot be used: {error}") from error


def safe_path(root: Path, name: str) -> Path:
    """`name` inside `root`, refused if it could lead anywhere else.

    Raises:
        UnsafePathError: absolute, with `..`, or through a symbolic link.
    """
    pure = PurePosixPath(name)
    if not name or pure.is_absolute() or ".." in pure.parts or "\\" in name or ":" in name:
        raise UnsafePathError(f"the manifest names {name!r}, which leaves the bundle {root}")
    file = root
    for piece in pure.parts:
        file = file / piece
        if file.is_symlink():
            raise UnsafePathError(f"{file} is a symbolic link; a bundle holds plain files only")
    return file


def graph_entries(manifest: Manifest) -> list[GraphEntry]:
    """All graphs of a bundle, in the order in which they run."""
    entries = [manifest.speech_encoder]
    for part in manifest.parts:
        entries += [part.decoder_step, part.motion_decoder, part.vertex_head]
    return entries


def load_array(root: Path, name: str, shape: tuple[int, ...], dtype: type[np.generic]) -> AnyArray:
    """The array in file `name`; -1 in `shape` is any size.

    Raises:
        ManifestError: not an array of that shape and dtype.
    """
    try:
        array: AnyArray = np.load(safe_path(root, name), allow_pickle=False)
    except (ValueError, EOFError) as error:
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


def _optional_array(
    root: Path, name: str | None, shape: tuple[int, ...], dtype: type[np.generic]
) -> AnyArray | None:
    return None if name is None else load_array(root, name, shape, dtype)


def _verify(file: Path, name: str, size: int, sha256: str) -> None:
    if not file.is_file():
        raise MissingFileError(f"{name} is missing from the bundle; copy or export it again")
    found = file.stat().st_size
    if found != size:
        raise AlteredFileError(
            f"{name} has {found} bytes, the manifest says {size}; copy or export it again"
        )
    digest = hashlib.sha256()
    with file.open("rb") as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    if digest.hexdigest() != sha256:
        raise AlteredFileError(
            f"{name} has changed since the export (its SHA-256 differs); copy or export it again"
        )


def _refuse_unlisted(manifest: Manifest) -> None:
    used = {g.path for g in graph_entries(manifest)} | {p.codebook for p in manifest.parts}
    used |= {f for f in (manifest.template, manifest.faces, manifest.colours) if f is not None}
    used |= {*manifest.regions.values(), *manifest.identities.values()}
    used |= {p.vertices for p in manifest.parts if p.vertices is not None}
    if unlisted := sorted(used - set(manifest.files)):
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
