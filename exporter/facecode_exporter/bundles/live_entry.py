"""Write into a bundle how it is streamed, beside everything that it holds already."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path

import numpy as np

from facecode.arrays import Audio
from facecode.bundle import read_manifest
from facecode.bundle_files import file_sha256
from facecode.errors import OutputWriteError
from facecode_spec.entries import FileEntry
from facecode_spec.live import LiveEntry
from facecode_spec.manifest import MANIFEST_NAME, Manifest

PRIMER = "primer.npy"


def store_live(root: Path, live: LiveEntry, primer: Audio) -> Manifest:
    """The new manifest of the bundle at `root`; other files, and what it says of them, stay.

    Args:
        root: the bundle.
        live: with any `primer`, which becomes the name of the file.
        primer: (n,) whole seconds at the bundle's rate.

    Raises:
        ManifestError: see `read_manifest`.
        OutputWriteError: the folder cannot be written.
    """
    manifest, file = read_manifest(root), root / PRIMER
    try:
        with tempfile.TemporaryDirectory(prefix=".live.", dir=root) as folder:
            fresh = Path(folder) / PRIMER
            np.save(fresh, primer.astype(np.float32))
            entry = FileEntry(fresh.stat().st_size, file_sha256(fresh))
            manifest = dataclasses.replace(
                manifest,
                live=dataclasses.replace(live, primer=PRIMER),
                files=dict(sorted({**manifest.files, PRIMER: entry}.items())),
            )
            fresh_manifest = Path(folder) / MANIFEST_NAME
            fresh_manifest.write_text(manifest.to_json(), encoding="utf-8")
            fresh.replace(file)
            fresh_manifest.replace(root / MANIFEST_NAME)
    except OSError as error:
        raise OutputWriteError(f"cannot write into {root}: {error}; copy the bundle") from error
    return manifest
