"""`facecode-export evaluate quiet`: how still streams of a bundle are where nobody speaks."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

import facecode
from facecode.bundle import PACKAGED_BUNDLE
from facecode.cli.options import Commands, positive
from facecode.errors import StyleError
from facecode_exporter.cli.options import add_threads, bar, check_json, deliver, vertex_pair


def add(kinds: Commands) -> argparse.ArgumentParser:
    """The kind `quiet`, with `run` set."""
    quiet = kinds.add_parser("quiet", help="streams in zeros and in the noise of rooms")
    quiet.set_defaults(run=run)
    quiet.add_argument(
        "--bundle",
        type=Path,
        metavar="DIR",
        default=PACKAGED_BUNDLE,
        help="default: the packaged one",
    )
    quiet.add_argument("--style", metavar="NAME", help="default: the bundle's first")
    quiet.add_argument("--lip-pair", type=vertex_pair, metavar="U,L", help="default: the bundle's")
    quiet.add_argument(
        "--seconds", type=positive(float), default=60.0, help="of each quiet (default: 60)"
    )
    quiet.add_argument("--rest-in-quiet", action="store_true", help="with the gate of streams")
    add_threads(quiet)
    return quiet


def run(args: argparse.Namespace) -> None:
    """`facecode-export evaluate quiet`."""
    from facecode_exporter.evaluation.quiet import judge_quiet, quiet_table
    from facecode_exporter.evaluation.speech import require_lip_pair

    check_json(args.json)
    animator = facecode.load(args.bundle, threads=args.threads)
    pair = require_lip_pair(animator, args.lip_pair)
    style = args.style or animator.styles[0]
    if style not in animator.styles:
        raise StyleError(f"got style {style}; this bundle has {', '.join(animator.styles)}")
    progress = bar("stream", args.quiet)
    found = list(judge_quiet(animator, style, pair, args.seconds, args.rest_in_quiet, progress))
    plain = {
        "bundle": str(args.bundle),
        "style": style,
        "seconds": args.seconds,
        "rest_in_quiet": args.rest_in_quiet,
        "quiet": [dataclasses.asdict(each) for each in found],
    }
    deliver(plain, quiet_table(found), args.json)
