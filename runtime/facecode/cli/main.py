"""The sub-commands of `facecode`: animate, batch, live, serve, convert, demo, mesh, info, bench."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path

import facecode
from facecode import writers
from facecode.audio import SPEECH
from facecode.bundle import PACKAGED, PACKAGED_BUNDLE, Bundle
from facecode.cli import animate, batch, bench_live, convert, live, mesh, serve
from facecode.cli.console import guarded
from facecode.cli.options import (
    AS_WRITTEN,
    STANDARD_STREAM,
    Commands,
    add_compute,
    add_debug,
    add_mode,
    add_quiet,
    add_style,
    compute_of,
    positive,
)
from facecode.options import parse_style

PROGRAM = "facecode"
DEMO_FACES = 5
EXAMPLES = """begin with:
  facecode demo                          the packaged voice and face, as demo.mp4 and demo.npz
  facecode animate my.wav -o talk.mp4    your own voice
  facecode info                          styles, identities and parts of the packaged bundle

`facecode COMMAND --help` explains each. More: README.md and docs/ of facecode."""


def parse_args(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line; argparse answers mistakes with exit code 2."""
    parser = argparse.ArgumentParser(
        PROGRAM,
        description="Speech in, 3D facial animation out.",
        epilog=EXAMPLES,
        formatter_class=AS_WRITTEN,
    )
    parser.add_argument("--version", action="version", version=f"facecode {facecode.__version__}")
    parser.set_defaults(debug=False)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for add in _PARSERS:
        add_debug(add(commands))
    return parser.parse_args(argv)


def _add_demo(commands: Commands) -> argparse.ArgumentParser:
    demo = commands.add_parser("demo", help="animate the packaged recording, to look at")
    demo.set_defaults(run=run_demo)
    demo.add_argument(
        "--diverse", action="store_true", help=f"{DEMO_FACES} faces for the one voice, side by side"
    )
    add_style(demo)
    demo.add_argument(
        "--template", metavar="NAME", help="an identity of the packaged bundle, or a mesh"
    )
    demo.add_argument(
        "--out", type=Path, metavar="DIR", default=Path(), help="an existing folder (default: here)"
    )
    add_compute(demo)
    add_quiet(demo)
    return demo


def _add_info(commands: Commands) -> argparse.ArgumentParser:
    info = commands.add_parser("info", help="show what a bundle is")
    info.set_defaults(run=run_info)
    _add_bundle(info)
    info.add_argument("--json", action="store_true", help="the manifest as JSON")
    return info


def _add_bench(commands: Commands) -> argparse.ArgumentParser:
    bench = commands.add_parser("bench", help="measure the latency per frame on this machine")
    bench.set_defaults(run=run_bench)
    _add_bundle(bench)
    bench.add_argument(
        "--seconds", type=positive(float), default=10.0, help="of speech (default: 10)"
    )
    bench.add_argument(
        "--compare", metavar="DIR", help="time this bundle too, the two in turns, and their ratio"
    )
    bench.add_argument(
        "--plot", type=Path, metavar="PNG", help="draw latency against frame index, as latency.png"
    )
    bench.add_argument("--json", metavar="FILE", help="write the numbers to FILE, or - for stdout")
    bench_live.add_options(bench)
    add_mode(bench)
    add_compute(bench)
    return bench


def _add_bundle(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "bundle",
        nargs="?",
        metavar="DIR",
        default=PACKAGED_BUNDLE,
        help="a bundle's folder, or a packaged bundle: demo, diverse (default: demo)",
    )


_PARSERS = (
    animate.add_parser,
    batch.add_parser,
    live.add_parser,
    serve.add_parser,
    convert.add_parser,
    _add_demo,
    mesh.add_parser,
    _add_info,
    _add_bench,
)


def run_demo(args: argparse.Namespace) -> None:
    """`facecode demo`: demo.npz and demo.mp4 of the packaged recording."""
    outputs = [args.out / "demo.npz", args.out / "demo.mp4"]
    for output in outputs:
        writers.check_output(output)
    path = PACKAGED["diverse" if args.diverse else "demo"]
    face = facecode.load(path, compute=compute_of(args))
    clip = face.animate(
        SPEECH,
        parse_style(args.style),
        template=args.template,
        samples=DEMO_FACES if args.diverse else None,
        progress=not args.quiet,
    )
    for output in outputs:
        clip.save(output, progress=not args.quiet)
        if not args.quiet:
            print(output.resolve())


def run_info(args: argparse.Namespace) -> None:
    """`facecode info`."""
    from facecode.cli.info import describe, summary

    bundle = Bundle.open(args.bundle)
    print(json.dumps(describe(bundle), indent=1) if args.json else summary(bundle))


def run_bench(args: argparse.Namespace) -> None:
    """`facecode bench`."""
    if args.live:
        bench_live.run(args)
        return
    from facecode.bench.measure import benchmark, compare
    from facecode.bench.report import comparison, plot, table

    report_file = None if args.json in (None, STANDARD_STREAM) else Path(args.json)
    for file in (report_file, args.plot):
        if file is not None:
            writers.check_folder(file)
    start = time.perf_counter()
    face = facecode.load(args.bundle, compute=compute_of(args))
    load_s = time.perf_counter() - start
    if args.compare is None:
        reports = [benchmark(face, load_s, args.seconds, face.window(args.mode, args.window))]
    else:
        both = [face, facecode.load(args.compare, compute=compute_of(args))]
        reports = compare(both, args.seconds, args.mode, args.window)
    if args.plot is not None:
        plot(reports, args.plot)
    plain = [report.to_plain() for report in reports]
    numbers = json.dumps(plain if args.compare else plain[0], indent=1)
    if args.json == STANDARD_STREAM:
        print(numbers)
        return
    print(table(reports[0]) if args.compare is None else comparison(*reports))
    if report_file is not None:
        with writers.writing(report_file) as file:
            file.write(f"{numbers}\n".encode())


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `facecode`."""
    args = parse_args(argv)
    return guarded(PROGRAM, lambda: args.run(args), args.debug)
