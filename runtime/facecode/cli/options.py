"""Options and values that the command lines share."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from facecode.bundle import PACKAGED_BUNDLE
from facecode.errors import SampleError
from facecode.options import MODES, Mode, Samples
from facecode.session import Compute

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
"""What `add_subparsers` returns."""

STANDARD_STREAM = "-"
AS_WRITTEN = argparse.RawDescriptionHelpFormatter
"""For examples: lines stay as they are."""


def positive(kind: type[int] | type[float]) -> Callable[[str], Any]:
    """A parser of numbers above zero, for argparse."""

    def convert(text: str) -> float:
        value = kind(text)
        if not 0 < value < float("inf"):
            raise argparse.ArgumentTypeError(f"expected a positive number, got {text}")
        return value

    convert.__name__ = kind.__name__
    return convert


def add_mode(parser: argparse.ArgumentParser, default: Mode = "exact") -> None:
    """`--mode` and `--window`."""
    auto = ""
    if default == "auto":
        auto = "; auto: exact up to 15 s of speech, window beyond; live: what a stream gives"
    parser.add_argument(
        "--mode",
        choices=[mode for mode in MODES if mode in ("exact", "window") or auto],
        default=default,
        help="exact: the trained system's codes, cost per frame grows with the clip; window: flat "
        f"cost per frame, any length, codes may differ{auto} (default: {default})",
    )
    parser.add_argument(
        "--window",
        type=positive(int),
        metavar="W",
        help="frames decoded at a step, with --mode window (default: the bundle's choice), as in "
        "--mode window --window 8",
    )


def add_look_ahead(parser: argparse.ArgumentParser) -> None:
    """`--look-ahead`."""
    parser.add_argument(
        "--look-ahead",
        type=positive(float),
        metavar="MS",
        help="speech that a stream hears after a block, as in --look-ahead 400 (default: 200)",
    )


def add_compute(parser: argparse.ArgumentParser, threads: int | None = None) -> None:
    """`--threads` and `--provider`."""
    parser.add_argument(
        "--threads",
        type=positive(int),
        metavar="N",
        default=threads,
        help=f"threads of a graph, as in --threads 2 (default: {threads or 'all cores'})",
    )
    parser.add_argument(
        "--provider",
        default="CPU",
        metavar="NAME",
        help="execution provider of the installed onnxruntime, as in --provider CUDA (default: "
        "CPU)",
    )


def add_bundle(parser: argparse.ArgumentParser) -> None:
    """`--bundle` and `--template`."""
    parser.add_argument(
        "--bundle",
        metavar="DIR",
        default=PACKAGED_BUNDLE,
        help="a bundle's folder, or a packaged bundle: demo, diverse (default: demo)",
    )
    parser.add_argument(
        "--template",
        metavar="MESH",
        help="an identity of the bundle, or .npy (V, 3), .ply, .obj, as in --template head.ply",
    )


def add_style(parser: argparse.ArgumentParser) -> None:
    """`--style`."""
    parser.add_argument(
        "--style",
        metavar="NAME",
        help="a style, or a mix such as calm:0.3,lively:0.7 (default: the bundle's first)",
    )


def add_debug(parser: argparse.ArgumentParser) -> None:
    """`--debug`."""
    parser.add_argument("--debug", action="store_true", help="show the traceback of errors")


def add_quiet(parser: argparse.ArgumentParser) -> None:
    """`--quiet`."""
    parser.add_argument("--quiet", action="store_true", help="no progress, no summary")


def compute_of(args: argparse.Namespace) -> Compute:
    """The value of `add_compute`'s options."""
    return Compute(args.threads, args.provider)


def parse_samples(texts: list[str], by_part: Mapping[str, int | None]) -> Samples | None:
    """Values of `--samples`, `K` or `PART=K`, and the short forms by part name.

    Raises:
        SampleError: not of this form, or a total beside numbers by part.
    """
    counts = {name: n for name, n in by_part.items() if n is not None}
    total = None
    for text in texts:
        name, equals, number = text.rpartition("=")
        if not number.isdigit() or int(number) < 1 or (equals and not name):
            raise SampleError(
                f"got --samples {text!r}; expected a number above 0 such as 5, or PART=5"
            )
        if equals:
            counts[name] = int(number)
        else:
            total = int(number)
    if total is not None and counts:
        raise SampleError("got --samples beside samples by part; give one or the other")
    return counts or total
