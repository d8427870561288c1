"""`facecode-export evaluate people`: a bundle beside people who were filmed while they spoke."""

from __future__ import annotations

import argparse
from pathlib import Path

import facecode
from facecode.bundle import PACKAGED_BUNDLE
from facecode.cli.options import Commands
from facecode.writers import check_folder
from facecode_exporter.cli.options import add_threads, bar, check_json, count, deliver

SPLITS = ("test", "others", "validation", "train")


def add(kinds: Commands) -> argparse.ArgumentParser:
    """The kind `people`, with `run` set."""
    people = kinds.add_parser("people", help="lips beside those of people on the same sound")
    people.set_defaults(run=run)
    people.add_argument(
        "--data", type=Path, metavar="DIR", required=True, help="sound, tracks and times of sounds"
    )
    people.add_argument(
        "--split",
        choices=SPLITS,
        default=SPLITS[0],
        help="of the speaker with the most clips, or the others (default: test)",
    )
    people.add_argument(
        "--bundle", metavar="DIR", default=PACKAGED_BUNDLE, help="default: the packaged one"
    )
    people.add_argument("--style", metavar="NAME", help="default: the bundle's first")
    people.add_argument(
        "--mode", choices=["exact", "window", "live"], default="exact", help="default: exact"
    )
    people.add_argument("--clips", type=count, metavar="N", help="the first N alone")
    people.add_argument("--plot", type=Path, metavar="PNG", help="curves around kinds of sounds")
    add_threads(people)
    return people


def run(args: argparse.Namespace) -> None:
    """`facecode-export evaluate people`."""
    from facecode_exporter.data.tracks import read_tracks
    from facecode_exporter.evaluation.people import judge_people
    from facecode_exporter.evaluation.people_report import plot, table
    from facecode_exporter.evaluation.plots import require_matplotlib

    check_json(args.json)
    if args.plot is not None:
        check_folder(args.plot)
        require_matplotlib()
    tracks = read_tracks(args.data, args.split)[: args.clips]
    animator = facecode.load(args.bundle, threads=args.threads)
    style = args.style or animator.styles[0]
    judged = judge_people(animator, tracks, style, bar("animate", args.quiet), mode=args.mode)
    if args.plot is not None:
        plot(judged, args.plot)
    about = {
        "data": str(args.data),
        "split": args.split,
        "bundle": str(args.bundle),
        "style": style,
        "mode": args.mode,
    }
    shown = table(judged, f"split {args.split}, style {style}, mode {args.mode}")
    deliver({**about, **judged.plain()}, shown, args.json)
