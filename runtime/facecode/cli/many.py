"""`facecode animate A B C --out-dir D`: many recordings, one file each."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from tqdm import tqdm

import facecode
from facecode import writers
from facecode.cli.console import DONE, MISTAKE
from facecode.cli.options import compute_of
from facecode.cli.saving import format_of
from facecode.errors import FacecodeError, OutputFolderError, OutputWriteError, SampleError
from facecode.options import parse_style


def run_many(args: argparse.Namespace) -> int:
    """Animate `args.audio` into `args.out_dir`; 2 if a recording failed, and the others done.

    Raises:
        OutputFolderError: no folder to make it in, or two recordings of one name.
        OutputWriteError: the folder cannot be made.
        SampleError: samples or held codes, which are for one recording.
    """
    if args.samples or args.hold:
        raise SampleError("samples and held codes are for one recording; give it alone, with -o")
    outputs = _outputs([Path(name) for name in args.audio], args.out_dir, f".{args.format}")
    style = parse_style(args.style)
    start, seconds, n_failed = time.perf_counter(), 0.0, 0
    face = facecode.load(args.bundle, compute=compute_of(args))
    _make_folder(args.out_dir)
    for output in outputs:
        writers.check_output(output)
        writers.check_face(
            writers.format_of(output), face.bundle.faces is not None, face.bundle.rig is not None
        )
    clips = facecode.animate_many(
        args.audio,
        style,
        face=face,
        mode=args.mode,
        window=args.window,
        look_ahead_ms=args.look_ahead,
        template=args.template,
    )
    bar = tqdm(clips, total=len(outputs), desc="animate", unit="clip", disable=args.quiet)
    for name, output, clip in zip(args.audio, outputs, bar, strict=True):
        try:
            if isinstance(clip, FacecodeError):
                raise clip
            writers.save(clip, output, found=format_of(output, args))
            seconds += clip.duration_s
        except FacecodeError as error:
            n_failed += 1
            tqdm.write(f"facecode: {name}: {error}", file=sys.stderr)
    if not args.quiet:
        took = time.perf_counter() - start
        print(
            f"{args.out_dir}: {len(outputs) - n_failed} of {len(outputs)} recordings, "
            f"{seconds:.1f} s of speech in {took:.1f} s ({seconds / took:.1f} s a second)"
        )
    return MISTAKE if n_failed else DONE


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except FileNotFoundError as error:
        raise OutputFolderError(
            f"the folder {folder.parent} does not exist; create it first"
        ) from error
    except OSError as error:
        raise OutputWriteError(
            f"cannot make the folder {folder}: {error.strerror}; name another with --out-dir"
        ) from error


def _outputs(sources: list[Path], folder: Path, suffix: str) -> list[Path]:
    outputs = [folder / f"{source.stem}{suffix}" for source in sources]
    if len(set(outputs)) < len(outputs):
        twice = sorted({o.name for o in outputs if outputs.count(o) > 1})
        raise OutputFolderError(
            f"several recordings would be written to {', '.join(twice)}; animate them in turn"
        )
    return outputs
