"""`facecode-export bench-reference`: thin over `compare`."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from facecode.writers import check_folder, writing
from facecode_exporter.cli.checkpoint_options import add_files, load_network

if TYPE_CHECKING:
    from facecode_spec.schema import SystemSpec

LENGTHS_S = (2.0, 6.0, 12.0, 20.0)
ROUNDS = 3


TIMED = ("exact", "window")


def add_parser(commands: Any) -> argparse.ArgumentParser:  # noqa: ANN401
    """Add the command to the sub-parsers of `facecode-export`."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "bench-reference", help="time the public PyTorch algorithm beside the runtime"
    )
    parser.set_defaults(run=run)
    parser.add_argument("bundles", nargs="+", type=Path, metavar="DIR", help="of these weights")
    add_files(parser)
    parser.add_argument(
        "--seconds", type=_lengths, default=LENGTHS_S, metavar="A,B", help="clips (2,6,12,20)"
    )
    parser.add_argument("--modes", type=_modes, default=TIMED, metavar="A,B", help=",".join(TIMED))
    parser.add_argument(
        "--window", type=int, metavar="W", help="of `window` (default: the choice of each bundle)"
    )
    parser.add_argument("--rounds", type=int, default=ROUNDS, help=f"median of ({ROUNDS})")
    parser.add_argument("--threads", type=int, metavar="N", help="default: all cores")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers to FILE")
    return parser


def run(args: argparse.Namespace) -> None:
    """Load the networks and the bundles, compare, print."""
    from facecode.animator import Animator
    from facecode.bundle import Bundle
    from facecode.session import Compute
    from facecode_exporter.bench_reference.compare import Contestant, compare
    from facecode_exporter.bench_reference.report import table

    if args.json is not None:
        check_folder(args.json)
    bundles = [Bundle.open(path) for path in args.bundles]
    system: SystemSpec = bundles[0].manifest.system
    net, _ = load_network(system, args)
    compute = Compute(args.threads)
    animators = [Animator(bundle, compute) for bundle in bundles]
    contestants = [
        Contestant(a, mode, a.window(mode, args.window if mode == "window" else None))
        for a in animators
        for mode in args.modes
        if mode in a.manifest.modes
    ]

    def progress(text: str) -> None:
        if not args.quiet:
            print(text, file=sys.stderr)

    result = compare(net, contestants, args.seconds, args.rounds, compute.n_threads, progress)
    print(table(result))
    if args.json is not None:
        with writing(args.json) as file:
            file.write(f"{json.dumps(result.to_plain(), indent=1)}\n".encode())


def _lengths(text: str) -> tuple[float, ...]:
    lengths = tuple(float(part) for part in text.split(","))
    if not all(0 < length < float("inf") for length in lengths):
        raise argparse.ArgumentTypeError(f"expected seconds such as 2,6,12,20; got {text}")
    return lengths


def _modes(text: str) -> tuple[str, ...]:
    modes = tuple(text.split(","))
    if unknown := set(modes) - set(TIMED):
        raise argparse.ArgumentTypeError(f"got {', '.join(unknown)}; expected {', '.join(TIMED)}")
    return modes
