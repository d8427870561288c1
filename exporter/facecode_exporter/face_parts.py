"""Which vertices are whose, in systems of several parts: from a file of the lips' vertices.

The lip part owns the vertices of the file, the other part the rest, in ascending order.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from facecode.arrays import Indices
from facecode_exporter.errors import RegionError
from facecode_exporter.measures.regions import read_region_file
from facecode_spec.schema import SystemSpec

LIPS = "lips"


def part_vertices(system: SystemSpec, lips: Path | None) -> dict[str, Indices]:
    """Vertex indices (n,) int32 by part name; together every vertex once. Empty for one part.

    Raises:
        RegionError: a system of parts without a file, or a file that does not fit the mesh.
    """
    if system.family != "cdface":
        return {}
    if lips is None:
        raise RegionError(
            f"{system.name} has the parts {', '.join(p.name for p in system.parts)}; give --lips "
            "FILE, the comma-separated indices of the lip part's vertices"
        )
    own = np.unique(read_region_file(lips))
    if own[-1] >= system.n_vertices or len(own) == system.n_vertices:
        raise RegionError(
            f"{lips} names {len(own):,} vertices up to {own[-1]:,}; expected some, not all, of the "
            f"{system.n_vertices:,} of {system.name}"
        )
    rest = np.setdiff1d(np.arange(system.n_vertices, dtype=np.int32), own)
    return {part.name: own if part.name == LIPS else rest for part in system.parts}


def with_vertices(system: SystemSpec, vertices: dict[str, Indices]) -> SystemSpec:
    """`system` with parts of the sizes that `vertices` gives them."""
    if not vertices:
        return system
    parts = tuple(
        dataclasses.replace(part, n_vertices=len(vertices[part.name])) for part in system.parts
    )
    return dataclasses.replace(system, parts=parts)


def variant(system: SystemSpec, samples: int | None, upper_first: bool) -> SystemSpec:
    """`system` with another number of samples of each part, or with its parts the other way round.

    One sample is the deterministic variant; upper face first is the paper's ablation of the order.
    """
    parts = system.parts
    if samples is not None:
        parts = tuple(dataclasses.replace(part, n_samples=samples) for part in parts)
    if upper_first:
        lips, upper = (dataclasses.replace(part, conditions_on=()) for part in parts)
        parts = (upper, dataclasses.replace(lips, conditions_on=(upper.name,)))
    return dataclasses.replace(system, parts=parts)
