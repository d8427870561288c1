"""What a caller knows of the face beside its mesh: units, regions and the lip pair."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from facecode.arrays import Indices
from facecode_exporter.bundles.neutral import Neutral
from facecode_exporter.bundles.units import read_units
from facecode_exporter.cli.options import vertex_pair
from facecode_exporter.errors import RegionError
from facecode_exporter.measures.regions import LIPS, UPPER_FACE, read_region_file

NAMES = (LIPS, UPPER_FACE)


def add_face_options(parser: argparse.ArgumentParser) -> None:
    """`--units`, `--regions` and `--lip-pair`."""
    parser.add_argument(
        "--units",
        type=Path,
        metavar="FILE.npz",
        help="face units for clip.weights and formats of weights: `names` (K,), such as ARKit's, "
        "and `deltas` (K, V, 3) from the template, as in --units arkit_on_flame.npz",
    )
    parser.add_argument(
        "--regions",
        action="append",
        default=[],
        type=_region,
        metavar="NAME=FILE",
        help="vertex indices that evaluation needs, as in --regions lips=lve.txt --regions "
        "upper_face=fdd.txt",
    )
    parser.add_argument(
        "--lip-pair",
        type=vertex_pair,
        metavar="UPPER,LOWER",
        help="inner-lip vertices whose distance is the mouth opening, as in --lip-pair 3531,3504",
    )


def with_face_options(neutral: Neutral, args: argparse.Namespace) -> Neutral:
    """The face with what the options say of it.

    Raises:
        UnitsError: units that cannot be read, or of another mesh.
        RegionError: a region file that cannot be read, or indices that the mesh does not have.
    """
    n = len(neutral.vertices)
    regions = {name: _inside(name, read_region_file(file), n) for name, file in args.regions}
    if args.lip_pair is not None:
        _inside("lip pair", np.array(args.lip_pair, np.int32), n)
    rig = None if args.units is None else read_units(args.units, n)
    return replace(neutral, regions=regions, lip_pair=args.lip_pair, rig=rig)


def _region(text: str) -> tuple[str, Path]:
    name, _, file = text.partition("=")
    if name not in NAMES or not file:
        raise argparse.ArgumentTypeError(f"expected lips=FILE or upper_face=FILE, got {text}")
    return name, Path(file)


def _inside(name: str, indices: Indices, n_vertices: int) -> Indices:
    if indices.max() >= n_vertices:
        raise RegionError(
            f"the {name} names vertex {indices.max():,}; the mesh has {n_vertices:,}. Give the "
            "indices of this topology"
        )
    return indices
