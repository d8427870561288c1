"""`facecode animate`: one recording to a file, or many to a folder."""

from __future__ import annotations

import argparse
import io
import sys
import time
from pathlib import Path

import facecode
from facecode import writers
from facecode.cli.hold_option import parse_hold
from facecode.cli.many import run_many
from facecode.cli.options import (
    AS_WRITTEN,
    STANDARD_STREAM,
    Commands,
    add_bundle,
    add_compute,
    add_look_ahead,
    add_mode,
    add_quiet,
    add_style,
    compute_of,
    parse_samples,
    positive,
)
from facecode.cli.saving import add_saving, check_saving, check_units, format_of, save
from facecode.errors import OutputFolderError, OutputSuffixError, SampleError
from facecode.options import Options, parse_style
from facecode.takes import Takes

EXAMPLES = """examples:
  facecode animate my.wav -o talk.npz                     arrays; 2.1 MB a second (packaged head)
  facecode animate my.wav -o talk.mp4 --style lively      a film to look at
  facecode animate my.wav -o talk.glb -o talk.csv         a head with 52 shapes, and their weights
  facecode animate my.wav -o five.mp4 --bundle diverse --samples 5
  facecode animate *.wav --out-dir talks --format glb     many recordings at once
  cat my.wav | facecode animate - -o - --format csv       between other programs

`facecode info` lists styles, identities and parts. More: README.md, docs/outputs.md of facecode."""


def add_parser(commands: Commands) -> argparse.ArgumentParser:
    """The sub-command `animate`, with `run` set."""
    animate = commands.add_parser(
        "animate", help="animate a recording", epilog=EXAMPLES, formatter_class=AS_WRITTEN
    )
    animate.set_defaults(run=run_animate)
    animate.add_argument(
        "audio", nargs="+", help="wav, flac, ogg, mp3, ... or - for standard input"
    )
    _add_output(animate)
    add_bundle(animate)
    add_style(animate)
    _add_samples(animate)
    add_mode(animate, "auto")
    add_look_ahead(animate)
    add_compute(animate)
    add_quiet(animate)
    return animate


def _add_output(animate: argparse.ArgumentParser) -> None:
    where = animate.add_mutually_exclusive_group(required=True)
    where.add_argument(
        "-o",
        "--output",
        action="append",
        metavar="FILE",
        help=f"{', '.join(writers.FORMATS)}, or -; several, as in -o talk.glb -o talk.csv",
    )
    add_saving(animate)
    where.add_argument(
        "--out-dir",
        type=Path,
        metavar="DIR",
        help="a folder, made if need be: one file a recording, several at once",
    )
    animate.add_argument(
        "--format",
        choices=[suffix[1:] for suffix in writers.FORMATS],
        help="of the files in --out-dir, or of -o - (default: npz)",
    )


def _add_samples(animate: argparse.ArgumentParser) -> None:
    animate.add_argument(
        "--samples",
        action="append",
        default=[],
        metavar="K",
        help="K faces for the one voice, as in --samples 5; or, again and again, samples by part, "
        "as in --samples lips=2 --samples upper_face=3",
    )
    animate.add_argument(
        "--lips", type=positive(int), metavar="K", help="short for --samples lips=K"
    )
    animate.add_argument(
        "--upper-face", type=positive(int), metavar="M", help="short for --samples upper_face=M"
    )
    animate.add_argument(
        "--hold",
        action="append",
        default=[],
        metavar="PART=FILE.npz[#K]",
        help="keep a part's codes from another result, as in --hold lips=talk.npz#2",
    )


def run_animate(args: argparse.Namespace) -> int | None:
    """`facecode animate`."""
    by_part = {"lips": args.lips, "upper_face": args.upper_face}
    args.samples = parse_samples(args.samples, by_part)
    if args.onto is not None and args.samples is not None:
        raise SampleError("--onto takes one face; leave --samples out")
    to_file = args.output not in (None, [STANDARD_STREAM])
    if args.format is not None and to_file:
        raise OutputSuffixError(
            "--format goes with --out-dir or -o -; the suffix of a file says it"
        )
    args.format = args.format or "npz"
    files = args.output if to_file else [f"all.{args.format}"]
    check_saving(args, [Path(name) for name in files])
    if args.out_dir is not None:
        return run_many(args)
    if len(args.audio) != 1:
        raise OutputFolderError(
            f"got {len(args.audio)} recordings and one output; name a folder with --out-dir"
        )
    _animate_one(args, args.audio[0])
    return None


def _animate_one(args: argparse.Namespace, source: str) -> None:
    to_stdout = args.output == [STANDARD_STREAM]
    outputs = (
        [Path(f"animation.{args.format}")] if to_stdout else [Path(name) for name in args.output]
    )
    for output in outputs:
        if str(output) == STANDARD_STREAM:
            raise OutputSuffixError("- stands alone; leave the other outputs out")
        (writers.check_format if to_stdout else writers.check_output)(output)
    hold = dict(parse_hold(text) for text in args.hold)
    audio = io.BytesIO(sys.stdin.buffer.read()) if source == STANDARD_STREAM else Path(source)
    start = time.perf_counter()
    face = facecode.load(args.bundle, compute=compute_of(args))
    formats = [format_of(output, args) for output in outputs]
    for found in formats:
        writers.check_face(found, face.bundle.faces is not None, face.bundle.rig is not None)
    check_units(args, face.bundle.rig)
    options: Options = {
        "mode": args.mode,
        "window": args.window,
        "look_ahead_ms": args.look_ahead,
        "template": args.template,
        "hold": hold,
        "vertices": not face.gives_weights or any(found.needs_vertices for found in formats),
        "progress": not args.quiet,
    }
    style = parse_style(args.style)
    if len(outputs) == 1 and args.samples is None and args.onto is None and not to_stdout:
        blocks = face.blocks(audio, style, **options)
        face_alone, n = blocks.still, blocks.n_frames
        writers.save_blocks(face_alone, n, blocks, outputs[0], not args.quiet, formats[0])
        summary = _summary(face_alone, n)
    else:
        clip = face.animate(audio, style, samples=args.samples, **options)
        if to_stdout:
            _write_stdout(clip, outputs[0])
            return
        for output in outputs:
            save(clip.clips if isinstance(clip, Takes) else clip, output, args)
        first = clip[0] if isinstance(clip, Takes) else clip
        summary = _summary(first, first.n_frames, len(clip) if isinstance(clip, Takes) else 1)
    if not args.quiet:
        names = ", ".join(map(str, outputs))
        print(f"{names}: {summary}, in {time.perf_counter() - start:.2f} s")


def _write_stdout(clip: facecode.Animation | Takes, output: Path) -> None:
    buffer = io.BytesIO()  # a zip file needs to seek
    several = clip.clips if isinstance(clip, Takes) else clip
    writers.write(several, buffer, writers.format_of(output))
    sys.stdout.buffer.write(buffer.getbuffer())
    sys.stdout.buffer.flush()


def _summary(face: facecode.Animation, n_frames: int, n_faces: int = 1) -> str:
    several = f"{n_faces} faces, " if n_faces > 1 else ""
    return (
        f"{several}{n_frames} frames at {face.fps:g} fps ({n_frames / face.fps:.2f} s), "
        f"{len(face.template):,} vertices, {face.mode} mode"
    )
