"""Options and values that the commands of `facecode-export` share."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from tqdm import tqdm

from facecode.arrays import Indices
from facecode.cli.options import STANDARD_STREAM
from facecode.writers import check_folder, writing
from facecode_exporter.errors import RunError
from facecode_exporter.face_parts import part_vertices, variant, with_vertices
from facecode_spec.schema import SystemSpec

T = TypeVar("T")


def vertex_pair(text: str) -> tuple[int, int]:
    """UPPER,LOWER as argparse reads it."""
    upper, _, lower = text.partition(",")
    if not (upper.isdigit() and lower.isdigit()):
        raise argparse.ArgumentTypeError(f"expected UPPER,LOWER vertex indices, got {text}")
    return int(upper), int(lower)


def system_name(known: Collection[str]) -> Callable[[str], str]:
    """A parser of names of systems: the published ones are offered, those of tests taken too."""

    def convert(text: str) -> str:
        if text not in known:
            raise argparse.ArgumentTypeError(
                f"no system {text!r}; expected one of {published(known)}"
            )
        return text

    return convert


def published(known: Collection[str]) -> str:
    """The published systems among `known`, for people."""
    return ", ".join(sorted(n for n in known if not n.endswith(("-tiny", "-demo"))))


def add_json(parser: argparse.ArgumentParser) -> None:
    """`--json`."""
    parser.add_argument("--json", metavar="FILE", help="write the numbers to FILE, or - for stdout")


def add_threads(parser: argparse.ArgumentParser) -> None:
    """`--threads`."""
    parser.add_argument("--threads", type=count, metavar="N", help="default: all cores")


def count(text: str) -> int:
    """A whole number above 0, as argparse reads it."""
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a positive whole number, got {text}")
    return int(text)


def share(text: str) -> float:
    """A number from 0 to 1, as argparse reads it."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 <= value <= 1:
        raise argparse.ArgumentTypeError(f"expected a share from 0 to 1, got {text}")
    return value


def check_json(file: str | None) -> None:
    """Refuse a file for `--json` that cannot be written, before the work is done.

    Raises:
        OutputFolderError, OutputWriteError.
    """
    if file not in (None, STANDARD_STREAM):
        check_folder(Path(file))


def deliver(plain: dict[str, Any], table: str, file: str | None) -> None:
    """Print the table, and write the numbers where `--json` says; `-` prints them instead."""
    numbers = json.dumps(plain, indent=1, allow_nan=False)
    if file == STANDARD_STREAM:
        print(numbers)
        return
    print(table)
    if file is not None:
        with writing(Path(file)) as output:
            output.write(f"{numbers}\n".encode())


def bar(what: str, quiet: bool) -> Callable[[Sequence[T]], Iterable[T]]:
    """A progress bar over clips on stderr."""
    return lambda work: tqdm(work, desc=what, unit="clip", disable=quiet)


def add_variant_options(parser: argparse.ArgumentParser) -> None:
    """The options of systems of several parts."""
    parser.add_argument(
        "--lips", type=Path, metavar="FILE", help="systems of parts: vertex indices of the lip part"
    )
    parser.add_argument("--samples", type=int, metavar="K", help="of each part (default: 5)")
    parser.add_argument(
        "--upper-first", action="store_true", help="the upper face first, then the lips"
    )


def divided(system: SystemSpec, args: argparse.Namespace) -> tuple[SystemSpec, dict[str, Indices]]:
    """The system that the options ask for, and the vertices of its parts.

    Raises:
        RegionError: see `part_vertices`.
    """
    if system.family != "cdface":
        return system, {}
    vertices = part_vertices(system, args.lips)
    return variant(with_vertices(system, vertices), args.samples, args.upper_first), vertices


def require_speech_encoder(args: argparse.Namespace) -> None:
    """Refuse to learn through random convolutions that nobody asked for.

    Raises:
        RunError
    """
    if args.speech_encoder is None and not args.random_speech_encoder:
        raise RunError(
            "no --speech-encoder: training keeps the convolutions of the speech encoder as they "
            "begin, and random ones tell little of speech; give a pretrained Hugging Face folder "
            "such as facebook/wav2vec2-base-960h, or --random-speech-encoder to go on without"
        )
