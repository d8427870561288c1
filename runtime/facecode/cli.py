"""`facecode`: animate speech, look at a bundle, measure it. Thin over the library."""

from __future__ import annotations

import argparse
import io
import json
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import facecode
from facecode import writers
from facecode.animator import Animator
from facecode.audio import SPEECH
from facecode.bundle import PACKAGED_BUNDLE, Bundle
from facecode.codes_file import parse_hold
from facecode.console import guarded
from facecode.errors import OutputFolderError, SampleError
from facecode.request import MODES
from facecode.samples import Samples
from facecode.styles import parse_style
from facecode.takes import Takes
from facecode.writers.atomic import check_folder, writing

PROGRAM = "facecode"
STANDARD_STREAM = "-"
DEMO_FACES = 5


def parse_args(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line; argparse answers mistakes with exit code 2."""
    parser = argparse.ArgumentParser(PROGRAM, description="Speech in, 3D facial animation out.")
    parser.add_argument("--version", action="version", version=f"facecode {facecode.__version__}")
    parser.set_defaults(debug=False)
    commands = parser.add_subparsers(dest="command", required=True)

    animate = commands.add_parser("animate", help="animate a recording")
    animate.set_defaults(run=run_animate)
    animate.add_argument(
        "audio", nargs="+", help="wav, flac, ogg, mp3, ... or - for standard input"
    )
    where = animate.add_mutually_exclusive_group(required=True)
    where.add_argument("-o", "--output", help=f"{_suffixes()}, or - (npz)")
    where.add_argument(
        "--out-dir",
        type=Path,
        metavar="DIR",
        help="a folder, made if need be: one file a recording, several at once",
    )
    animate.add_argument(
        "--format", choices=[s[1:] for s in writers.FORMATS], default="npz", help="with --out-dir"
    )
    animate.add_argument("--bundle", type=Path, metavar="DIR", default=PACKAGED_BUNDLE)
    animate.add_argument("--style", type=str, help="a name, or a mix such as a:0.3,b:0.7")
    animate.add_argument(
        "--template", metavar="MESH", help="an identity of the bundle, or .npy (V, 3), .ply, .obj"
    )
    animate.add_argument(
        "--samples", type=_positive(int), metavar="K", help="faces for the one voice"
    )
    animate.add_argument("--lips", type=_positive(int), metavar="K", help="samples of the lips")
    animate.add_argument(
        "--upper-face", type=_positive(int), metavar="M", help="upper faces for each of the lips"
    )
    animate.add_argument(
        "--hold",
        action="append",
        default=[],
        metavar="PART=FILE.npz[#K]",
        help="keep that part's codes",
    )
    _add_mode(animate)
    _add_threads(animate)
    animate.add_argument("--quiet", action="store_true", help="no progress, no summary")

    demo = commands.add_parser("demo", help="animate the packaged recording, to look at")
    demo.set_defaults(run=run_demo)
    demo.add_argument(
        "--diverse", action="store_true", help=f"{DEMO_FACES} faces for the one voice, side by side"
    )
    demo.add_argument("--style", help="a name, or a mix such as a:0.3,b:0.7")
    demo.add_argument("--template", metavar="MESH", help="an identity of the packaged bundle")
    demo.add_argument("--out", type=Path, metavar="DIR", default=Path(), help="default: here")
    _add_threads(demo)
    demo.add_argument("--quiet", action="store_true", help="no progress, no summary")

    info = commands.add_parser("info", help="show what a bundle is")
    info.set_defaults(run=run_info)
    info.add_argument("bundle", nargs="?", type=Path, metavar="DIR", default=PACKAGED_BUNDLE)
    info.add_argument("--json", action="store_true", help="the manifest as JSON")

    bench = commands.add_parser("bench", help="measure the latency per frame on this CPU")
    bench.set_defaults(run=run_bench)
    bench.add_argument("bundle", nargs="?", type=Path, metavar="DIR", default=PACKAGED_BUNDLE)
    bench.add_argument("--seconds", type=_positive(float), default=10.0, help="of speech (10)")
    bench.add_argument("--compare", type=Path, metavar="DIR", help="another bundle, in turns")
    bench.add_argument("--plot", type=Path, metavar="PNG", help="latency against frame index")
    bench.add_argument("--json", metavar="FILE", help="write the numbers to FILE, or - ")
    _add_mode(bench)
    _add_threads(bench)

    for command in (animate, demo, info, bench):
        command.add_argument("--debug", action="store_true", help="show the traceback of errors")
    return parser.parse_args(argv)


def run_animate(args: argparse.Namespace) -> int | None:
    """`facecode animate`."""
    if args.out_dir is not None:
        from facecode.cli_many import run_many

        return run_many(args)
    if len(args.audio) != 1:
        raise OutputFolderError(
            f"got {len(args.audio)} recordings and one output; name a folder with --out-dir"
        )
    _animate_one(args, args.audio[0])
    return None


def _animate_one(args: argparse.Namespace, source: str) -> None:
    to_stdout = args.output == STANDARD_STREAM
    output = Path("animation.npz" if to_stdout else args.output)
    if not to_stdout:
        writers.check_output(output)
    hold = dict(parse_hold(text) for text in args.hold)
    audio = io.BytesIO(sys.stdin.buffer.read()) if source == STANDARD_STREAM else Path(source)
    start = time.perf_counter()
    face = facecode.load(args.bundle, threads=args.threads)
    writers.check_face(writers.format_of(output), face.bundle.faces is not None, False)
    clip = face.animate(
        audio,
        None if args.style is None else parse_style(args.style),
        mode=args.mode,
        window=args.window,
        template=args.template,
        samples=_samples(args),
        hold=hold,
        progress=not args.quiet,
    )
    if to_stdout:
        buffer = io.BytesIO()  # a zip file needs to seek
        writers.write(
            clip.clips if isinstance(clip, Takes) else clip, buffer, writers.format_of(output)
        )
        sys.stdout.buffer.write(buffer.getbuffer())
        sys.stdout.buffer.flush()
        return
    clip.save(output, progress=not args.quiet)
    if not args.quiet:
        several = f"{len(clip)} faces, " if isinstance(clip, Takes) else ""
        first = clip[0] if isinstance(clip, Takes) else clip
        print(
            f"{output}: {several}{len(first.codes)} frames at {first.fps:g} fps "
            f"({first.duration_s:.2f} s), {first.template.shape[0]:,} vertices, "
            f"in {time.perf_counter() - start:.2f} s"
        )


def _samples(args: argparse.Namespace) -> Samples | None:
    """`--samples`, or `--lips` and `--upper-face` by part name."""
    by_part = {name: n for name, n in (("lips", args.lips), ("upper_face", args.upper_face)) if n}
    if by_part and args.samples:
        raise SampleError("got --samples beside samples by part; give one or the other")
    return by_part or args.samples


def run_demo(args: argparse.Namespace) -> None:
    """`facecode demo`: demo.npz and demo.mp4 of the packaged recording."""
    outputs = [args.out / "demo.npz", args.out / "demo.mp4"]
    for output in outputs:
        writers.check_output(output)
    face = facecode.load("diverse" if args.diverse else None, threads=args.threads)
    clip = face.animate(
        SPEECH,
        None if args.style is None else parse_style(args.style),
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
    from facecode.info import describe, summary

    bundle = Bundle.open(args.bundle)
    print(json.dumps(describe(bundle), indent=1) if args.json else summary(bundle))


def run_bench(args: argparse.Namespace) -> None:
    """`facecode bench`."""
    from facecode.bench import benchmark, compare
    from facecode.bench_report import comparison, plot, table

    report_file = None if args.json in (None, STANDARD_STREAM) else Path(args.json)
    for file in (report_file, args.plot):
        if file is not None:
            check_folder(file)
    start = time.perf_counter()
    animator: Animator = facecode.load(args.bundle, threads=args.threads)
    load_s = time.perf_counter() - start
    if args.compare is None:
        window = animator.window_frames(args.mode, args.window)
        reports = [benchmark(animator, load_s, args.seconds, window)]
    else:
        both = [animator, facecode.load(args.compare, threads=args.threads)]
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
        with writing(report_file) as file:
            file.write(f"{numbers}\n".encode())


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `facecode`."""
    args = parse_args(argv)
    return guarded(PROGRAM, lambda: args.run(args), args.debug)


def _suffixes() -> str:
    return ", ".join(writers.FORMATS)


def _add_mode(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--mode", choices=MODES, default="exact")
    parser.add_argument("--window", type=_positive(int), metavar="W", help="frames (window mode)")


def _add_threads(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--threads", type=_positive(int), metavar="N", help="default: all cores")


def _positive(kind: type[int] | type[float]) -> Callable[[str], float]:
    def convert(text: str) -> float:
        value = kind(text)
        if not 0 < value < float("inf"):
            raise argparse.ArgumentTypeError(f"expected a positive number, got {text}")
        return value

    convert.__name__ = kind.__name__
    return convert


if __name__ == "__main__":
    sys.exit(main())
