"""`facecode mesh`: the neutral face, for what moves vertices by their order."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from facecode.animation import Animation
from facecode.bundle import Bundle
from facecode.cli.options import Commands, add_bundle


def add_parser(commands: Commands) -> argparse.ArgumentParser:
    """The sub-command `mesh`, with `run` set."""
    parser = commands.add_parser("mesh", help="write the neutral face as a mesh")
    parser.set_defaults(run=run_mesh)
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="FILE",
        help=".obj (for .pc2 and .mdd), .ply or .glb, as in -o neutral.obj",
    )
    add_bundle(parser)
    return parser


def run_mesh(args: argparse.Namespace) -> None:
    """`facecode mesh`."""
    from facecode.writers.mesh import check_mesh, save_mesh

    check_mesh(args.output)
    bundle = Bundle.open(args.bundle)
    still = dataclasses.replace(Animation.still(bundle), template=bundle.neutral(args.template))
    save_mesh(still, args.output)
