"""`facecode-export evaluate live`: how far streams of a bundle are from whole recordings."""

from __future__ import annotations

import argparse
import dataclasses
import sys
from pathlib import Path

from facecode.animator import Animator
from facecode.bundle import PACKAGED_BUNDLE, Bundle
from facecode.cli.options import Commands, positive
from facecode.errors import StyleError
from facecode.live.plan import Plan, live_entry
from facecode.live.primed import primer_of
from facecode.session import Compute
from facecode_exporter.cli.options import add_threads, bar, check_json, deliver, vertex_pair
from facecode_spec.plain import to_plain


def add(kinds: Commands) -> argparse.ArgumentParser:
    """The kind `live`, with `run` set."""
    live = kinds.add_parser("live", help="streams against whole recordings, by look-ahead")
    live.set_defaults(run=run)
    live.add_argument("recordings", type=Path, metavar="RECORDINGS", help="wav or flac with .txt")
    live.add_argument(
        "--bundle",
        type=Path,
        metavar="DIR",
        default=PACKAGED_BUNDLE,
        help="default: the packaged one",
    )
    live.add_argument("--style", metavar="NAME", help="default: the bundle's first")
    live.add_argument("--lip-pair", type=vertex_pair, metavar="U,L", help="default: the bundle's")
    for name in ("context", "block"):
        live.add_argument(
            f"--{name}", type=positive(float), metavar="S", help="seconds; default: the bundle's"
        )
    live.add_argument(
        "--store", action="store_true", help="write plan, primer and numbers into the bundle"
    )
    add_threads(live)
    return live


def run(args: argparse.Namespace) -> None:
    """`facecode-export evaluate live`."""
    from facecode_exporter.bundles.live_entry import store_live
    from facecode_exporter.data.recordings import load_aligner, read_recordings
    from facecode_exporter.evaluation.live import live_table, measure_live, with_plan
    from facecode_exporter.evaluation.speech import require_lip_pair

    check_json(args.json)
    bundle = with_plan(Bundle.open(args.bundle), args.context, args.block)
    animator = Animator(bundle, Compute(threads=args.threads))
    pair = require_lip_pair(animator, args.lip_pair)
    style = args.style or animator.styles[0]
    if style not in animator.styles:
        raise StyleError(f"got style {style}; this bundle has {', '.join(animator.styles)}")
    recordings, skipped = read_recordings(args.recordings, load_aligner(), bar("align", args.quiet))
    for name, reason in skipped:
        print(f"facecode-export: left out {name}: {reason}", file=sys.stderr)
    measured = measure_live(animator, recordings, style, pair, bar("animate", args.quiet))
    entry = dataclasses.replace(live_entry(bundle.manifest), measured=measured)
    if args.store:
        store_live(bundle.root, entry, primer_of(bundle))
    plan = Plan.of(bundle.manifest)
    about = (
        f"{bundle.manifest.name}, style {style}, {measured.n_recordings} recordings of "
        f"{measured.seconds:g} s; context {1000 * plan.context / plan.fps:.0f} ms, block "
        f"{1000 * plan.block / plan.fps:.0f} ms, shown {plan.delay} frames late"
    )
    plain = {"bundle": str(args.bundle), "recordings": str(args.recordings), **to_plain(entry)}
    deliver(plain | {"left_out": dict(skipped)}, f"{about}\n{live_table(measured)}", args.json)
