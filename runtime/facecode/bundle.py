"""Open a bundle, a folder with manifest.json, graphs and arrays, and verify it.

Knows nothing of onnxruntime.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Colours, Faces, Indices, Template
from facecode.bundle_files import load_array, load_optional_array, safe_path, verify_files
from facecode.clip import Rig
from facecode.errors import (
    BundleNotFoundError,
    ManifestError,
    NewerBundleError,
    TemplateError,
)
from facecode.rig_file import read_rig
from facecode.template import TemplateSource, check_fit, load_template
from facecode.wording import one_line
from facecode_spec.entries import PartEntry
from facecode_spec.manifest import MANIFEST_NAME, Manifest, NewerFormatError
from facecode_spec.plain import SpecError

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
    rig: Rig | None = None

    def __repr__(self) -> str:
        m = self.manifest
        return (
            f"<Bundle {str(self.root)!r}: {m.family}, {m.n_vertices:,} vertices at {m.fps:g} fps>"
        )

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Bundle:
        """Read the manifest at `path` and verify every file that it lists.

        Args:
            path: a folder, or the name of a packaged bundle where no bundle folder has that name.

        Raises:
            BundleNotFoundError, ManifestError, NewerBundleError, UnsafePathError,
            MissingFileError, AlteredFileError, ExternalDataError.
        """
        root = Path(path)
        name = os.fspath(path)
        if name in PACKAGED and not _is_bundle(root):
            root = PACKAGED[name]
        manifest = read_manifest(root)
        verify_files(root, manifest)
        template = load_array(root, manifest.template, (manifest.n_vertices, 3), np.float32)
        faces = load_optional_array(root, manifest.faces, (-1, 3), np.int32)
        colours = load_optional_array(root, manifest.colours, (manifest.n_vertices, 3), np.uint8)
        rig = None
        if manifest.rig is not None:
            file = safe_path(root, manifest.rig.deltas)
            rig = read_rig(file, manifest.rig.names, manifest.n_vertices)
        bundle = cls(root, manifest, template, faces, colours, rig)
        bundle._check_parts()
        return bundle

    def _check_parts(self) -> None:
        """Refuse parts that leave a vertex out, or move it twice."""
        everything = np.arange(self.manifest.n_vertices)
        parts = [self.part_vertices(part) for part in self.manifest.parts]
        covered = np.concatenate([everything if p is None else p for p in parts])
        if not np.array_equal(np.sort(covered), everything):
            raise ManifestError(
                f"the parts of {self.root} do not move every vertex once ({len(covered)} indices "
                f"for {len(everything)} vertices); export it again"
            )

    @property
    def lip_pair(self) -> tuple[int, int] | None:
        """Upper and lower inner-lip vertex, where the bundle knows them."""
        pair = self.manifest.lip_pair
        return None if pair is None else (pair[0], pair[1])

    def neutral(self, template: TemplateSource | None) -> Template:
        """The neutral face (V, 3) that `template` names; the bundle's own for None.

        Raises:
            TemplateError
        """
        if template is None:
            return self.template
        if isinstance(template, str) and template in self.manifest.identities:
            return self.identity(template)
        m = self.manifest
        if isinstance(template, str) and m.identities and not Path(template).exists():
            raise TemplateError(
                f"no template file at {template}, and no identity of that name; the identities are "
                f"{', '.join(m.identities)}"
            )
        found = load_template(template, m.n_vertices)
        if m.has_template:
            check_fit(found, self.template, m.unit)
        return found

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

    def rig_projection(self, part: PartEntry) -> NDArray[np.float64] | None:
        """What gives weights of the rig without vertices, (U, E + 1); None: not known.

        Raises:
            ManifestError
        """
        if part.rig_projection is None or self.rig is None:
            return None
        hidden = part.vertex_head.input("hidden").axes[2]
        shape = (len(self.rig.names), int(hidden) + 1)
        return load_array(self.root, part.rig_projection, shape, np.float64)

    def path(self, name: str) -> Path:
        """Where the file `name` of the manifest lies."""
        return safe_path(self.root, name)


def _is_bundle(root: Path) -> bool:
    """Whether the folder is meant as a bundle: others have a manifest.json too, as web pages do."""
    try:
        return b'"format_version"' in (root / MANIFEST_NAME).read_bytes()
    except OSError:
        return False


def read_manifest(root: Path) -> Manifest:
    """The manifest of the bundle at `root`.

    Raises:
        BundleNotFoundError, ManifestError, NewerBundleError.
    """
    file = root / MANIFEST_NAME
    if not file.is_file():
        reason = "the folder does not exist" if not root.is_dir() else f"it has no {MANIFEST_NAME}"
        raise BundleNotFoundError(
            f"no bundle at {root}: {reason}. Make one with 'facecode-export export'"
        )
    try:
        return Manifest.from_json(file.read_text(encoding="utf-8"))
    except NewerFormatError as error:
        raise NewerBundleError(f"{root}: {error}. Upgrade facecode, or export again") from error
    except (SpecError, UnicodeDecodeError) as error:
        raise ManifestError(f"{file} cannot be used: {one_line(error)}") from error
