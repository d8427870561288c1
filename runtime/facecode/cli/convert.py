"""`facecode convert`: a clip that was saved as .npz to any other format."""

from __future__ import annotations

import argparse
from pathlib import Path

from facecode import writers
from facecode.cli.options import Commands, add_quiet
from facecode.cli.saving import add_saving, check_saving, check_units, format_of, save
from facecode.clip_file import read_clip


def add_parser(commands: Commands) -> argparse.ArgumentParser:
    """The sub-command `convert`, with `run` set."""
    parser = commands.add_parser("convert", help="write a saved .npz in another format")
    parser.set_defaults(run=run_convert)
    parser.add_argument("clip", type=Path, metavar="CLIP.npz", help="what animate wrote")
    parser.add_argument(
        "-o",
        "--output",
        action="append",
        required=True,
        type=Path,
        metavar="FILE",
        help=f"{', '.join(writers.FORMATS)}; several, as in -o talk.glb -o talk.csv",
    )
    parser.add_argument(
        "--face",
        type=int,
        default=0,
        metavar="K",
        help="which of several faces, counted from 0, as in --face 2 (default: 0)",
    )
    add_saving(parser)
    add_quiet(parser)
    return parser


def run_convert(args: argparse.Namespace) -> None:
    """`facecode convert`."""
    for output in args.output:
        writers.check_output(output)
    check_saving(args, args.output)
    clip = read_clip(args.clip, args.face)
    for output in args.output:
        found = format_of(output, args)
        writers.check_face(found, clip.faces is not None, clip.rig is not None)
    check_units(args, clip.rig)
    for output in args.output:
        save(clip, output, args)
        if not args.quiet:
            print(output)
