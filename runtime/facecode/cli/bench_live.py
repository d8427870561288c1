"""`facecode bench --live`."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import facecode
from facecode import writers
from facecode.cli.options import STANDARD_STREAM, compute_of, positive


def add_options(bench: argparse.ArgumentParser) -> None:
    """What `bench` takes for streams."""
    bench.add_argument(
        "--live", action="store_true", help="feed streams in real time: latency, cost, memory"
    )
    bench.add_argument(
        "--streams", type=positive(int), default=1, metavar="N", help="at once (default: 1)"
    )
    bench.add_argument(
        "--look-ahead", type=float, metavar="MS", help="of the streams (default: the bundle's)"
    )
    bench.add_argument(
        "--fast", action="store_true", help="feed the streams as fast as they go, not in real time"
    )


def run(args: argparse.Namespace) -> None:
    """Feed the streams, and say what came of it."""
    from facecode.bench.live import bench_live, live_table

    report_file = None if args.json in (None, STANDARD_STREAM) else Path(args.json)
    if report_file is not None:
        writers.check_folder(report_file)
    face = facecode.load(args.bundle, compute=compute_of(args))
    report = bench_live(face, args.seconds, args.look_ahead, args.streams, not args.fast)
    numbers = json.dumps(report.to_plain(), indent=1)
    print(numbers if args.json == STANDARD_STREAM else live_table(report))
    if report_file is not None:
        with writers.writing(report_file) as file:
            file.write(f"{numbers}\n".encode())
