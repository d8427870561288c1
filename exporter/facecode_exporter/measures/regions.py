"""Which vertices are lips and which the upper face: from region files, or from a bundle.

A region file is one line of comma-separated vertex indices, as BIWI's `lve.txt` and `fdd.txt`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from facecode.arrays import Indices
from facecode.bundle import Bundle
from facecode_exporter.errors import RegionError

LIPS, UPPER_FACE = "lips", "upper_face"


@dataclass(frozen=True)
class Regions:
    """Vertex indices (n,) int32. A vertex that is named twice counts twice in FDD."""

    lips: Indices
    upper_face: Indices


def read_regions(lips: Path | None, upper_face: Path | None, bundle: Bundle | None) -> Regions:
    """Each region from its file where one is given, from the bundle otherwise.

    Raises:
        RegionError: neither has it, or a file cannot be read.
    """
    return Regions(
        _region(LIPS, "--lips", lips, bundle),
        _region(UPPER_FACE, "--upper-face", upper_face, bundle),
    )


def read_region_file(path: Path) -> Indices:
    """Vertex indices of one region file, in file order; line breaks and a last comma are allowed.

    Raises:
        RegionError: missing, empty, or anything else than whole numbers of 0 or more.
    """
    try:
        text = path.read_text(encoding="utf-8").strip().rstrip(",")
    except (OSError, UnicodeDecodeError) as error:
        raise RegionError(f"region file {path} cannot be read: {error}") from error
    try:
        indices = np.array([int(word) for word in text.split(",")], dtype=np.int32)
    except (ValueError, OverflowError) as error:
        raise RegionError(
            f"region file {path}: {error}; expected comma-separated vertex indices: 12, 13, 40"
        ) from error
    if indices.min() < 0:
        raise RegionError(f"region file {path} names vertex {indices.min()}; expected 0 or more")
    return indices


def require_inside(regions: Regions, n_vertices: int) -> None:
    """Refuse regions that the mesh does not have.

    Raises:
        RegionError
    """
    for name, indices in ((LIPS, regions.lips), (UPPER_FACE, regions.upper_face)):
        if not len(indices):
            raise RegionError(f"the region {name} is empty; expected at least one vertex")
        if indices.max() >= n_vertices:
            raise RegionError(
                f"the region {name} names vertex {indices.max():,}; the mesh has {n_vertices:,}. "
                "Give the region file of this topology"
            )


def _region(name: str, option: str, path: Path | None, bundle: Bundle | None) -> Indices:
    if path is not None:
        return read_region_file(path)
    if bundle is not None and name in bundle.manifest.regions:
        return bundle.region(name)
    where = "no bundle is given" if bundle is None else f"{bundle.root} names none"
    raise RegionError(f"the region {name} is not known ({where}); give {option} FILE")
