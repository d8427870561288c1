"""What a command line says of its outputs beside their names: `--onto` and `--vrma`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from facecode import writers
from facecode.clip import Clip, Rig
from facecode.errors import NoRigError, OutputSuffixError
from facecode.writers.format import Format
from facecode.writers.onto import check_avatar, onto
from facecode.writers.vrma import KINDS, VRMA


def add_saving(parser: argparse.ArgumentParser) -> None:
    """`--onto` and `--vrma`."""
    parser.add_argument(
        "--onto",
        type=Path,
        metavar="HEAD.glb",
        help="write your own avatar (.glb, .gltf, .vrm with ARKit-named shapes) with the animation "
        "added, as in -o talk.glb --onto my_head.glb",
    )
    parser.add_argument(
        "--vrma",
        choices=tuple(KINDS),
        help="expressions of a .vrma: custom, a unit each, as avatars for ARKit tracking (Perfect "
        "Sync) name them; presets: aa, ih, ou, ee, oh and blinks, which any VRM has (default: "
        "custom)",
    )


def check_saving(args: argparse.Namespace, outputs: Sequence[Path]) -> None:
    """Refuse options that do not go with the outputs, before the work is done.

    Raises:
        OutputSuffixError
    """
    suffixes = [output.suffix.lower() for output in outputs]
    if args.onto is not None and suffixes != [".glb"]:
        raise OutputSuffixError("--onto writes one .glb; give -o FILE.glb")
    if args.vrma is not None and VRMA.suffix not in suffixes:
        raise OutputSuffixError("--vrma is for a .vrma; give -o FILE.vrma")


def check_units(args: argparse.Namespace, rig: Rig | None) -> None:
    """Refuse an avatar that the face units of a rig do not move, before the work is done.

    Raises:
        NoRigError, AvatarNotFoundError, OntoError.
    """
    if args.onto is not None:
        if rig is None:
            raise NoRigError.to_write("weights")
        check_avatar(args.onto, rig.names)


def format_of(output: Path, args: argparse.Namespace) -> Format:
    """The format of an output, as the options want it.

    Raises:
        OutputSuffixError: no format with that suffix.
    """
    found = writers.format_of(output)
    return KINDS[args.vrma] if found is VRMA and args.vrma is not None else found


def save(clips: Clip | Sequence[Clip], output: Path, args: argparse.Namespace) -> None:
    """Write a face, or several of one recording, as the options want it.

    Raises:
        See `writers.save` and `writers.onto.onto`.
    """
    if args.onto is None:
        writers.save(clips, output, not args.quiet, format_of(output, args))
        return
    assert isinstance(clips, Clip)
    with writers.writing(output) as file:
        report = onto(clips, args.onto, file)
    if not args.quiet:
        print(report.describe())
