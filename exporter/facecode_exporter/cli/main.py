"""`facecode-export`: checkpoints to bundles, random checkpoints, and the comparison with torch."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import facecode
from facecode.cli.console import guarded
from facecode.cli.options import AS_WRITTEN, add_debug, add_quiet
from facecode.errors import MissingExtraError
from facecode_exporter.cli.bench_reference import add_parser as add_bench_reference
from facecode_exporter.cli.checkpoint_options import (
    add_checkpoints,
    chosen_system,
    load_network,
)
from facecode_exporter.cli.demo import (
    add_baseline_parser,
    add_captured_parser,
    add_model_parser,
    add_visemes_parser,
)
from facecode_exporter.cli.demo import add_parser as add_corpus_parser
from facecode_exporter.cli.evaluate import add_parser as add_evaluate
from facecode_exporter.cli.face_options import add_face_options
from facecode_exporter.cli.options import (
    add_variant_options,
    divided,
    published,
    system_name,
)
from facecode_exporter.cli.train import add_parser as add_train_parser
from facecode_spec.systems import SYSTEMS

if TYPE_CHECKING:
    from facecode.animator import Animator
    from facecode_exporter.bundles.parity import Case

PROGRAM = "facecode-export"
PRINTED = """what is printed at the end, once the runtime has been compared with torch:
  codes equal             how many motion codes of the bundle are those of torch; all, or no bundle
  smallest code margin    how near a second code ever came to the chosen one, relative to distance;
                          far above 1e-6, other processors choose the same codes
  lips deviate by 3 %     int8, or `window`: the lip error against float32, or `exact`, as a
                          share of how far the lips move from rest

More: README.md and docs/bundle-format.md of facecode."""
EXTRA_MODULES = {"torch", "onnx", "onnxscript", "transformers", "yaml"}


def parse_args(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line; argparse answers mistakes with exit code 2."""
    parser = argparse.ArgumentParser(PROGRAM, description="Export trained systems to bundles.")
    parser.add_argument("--version", action="version", version=f"facecode {facecode.__version__}")
    commands = parser.add_subparsers(dest="command", required=True)

    export = commands.add_parser(
        "export", help="checkpoint files to a bundle", epilog=PRINTED, formatter_class=AS_WRITTEN
    )
    export.set_defaults(run=run_export)
    add_checkpoints(export, system_required=True)
    export.add_argument("--template", type=Path, metavar="MESH", help=".ply, .obj or .npy (V, 3)")
    add_face_options(export)
    add_variant_options(export)
    export.add_argument(
        "--precision", choices=("fp32", "int8"), default="fp32", help="of the weights (fp32)"
    )
    export.add_argument(
        "--any-deviation", action="store_true", help="int8 even if it changes the motion much"
    )
    export.add_argument("--out", type=Path, required=True, metavar="DIR", help="the bundle")

    init = commands.add_parser("init", help="random weights in the public checkpoint layout")
    init.set_defaults(run=run_init)
    init.add_argument(
        "--system",
        type=system_name(SYSTEMS),
        required=True,
        metavar="NAME",
        help=f"its sizes: {published(SYSTEMS)}",
    )
    init.add_argument("--seed", type=int, default=0, help="of the weights (default: 0)")
    init.add_argument("--out", type=Path, required=True, metavar="DIR", help="for the files")

    verify = commands.add_parser("verify", help="compare a bundle with torch")
    verify.set_defaults(run=run_verify)
    verify.add_argument("bundle", type=Path, metavar="DIR", help="the bundle")
    add_checkpoints(verify, system_required=False)
    verify.add_argument("--audio", type=Path, help="a recording to compare on, whole")
    verify.add_argument("--style", help="for --audio: a name, or a mix such as a:0.3,b:0.7")

    add_evaluate(commands)
    corpora = (add_corpus_parser, add_captured_parser, add_visemes_parser)
    training = (add_train_parser, add_model_parser, add_baseline_parser)
    more = (*corpora, *training, add_bench_reference)

    for command in (export, init, verify, *(add(commands) for add in more)):
        add_debug(command)
        add_quiet(command)
    return parser.parse_args(argv)


def run_export(args: argparse.Namespace) -> None:
    """`facecode-export export`."""
    from facecode_exporter.bundles.deviation import describe_deviation
    from facecode_exporter.bundles.neutral import read_neutral
    from facecode_exporter.bundles.parity import describe_case
    from facecode_exporter.bundles.writer import write_bundle
    from facecode_exporter.cli.face_options import with_face_options

    system, own = divided(chosen_system(args), args)
    neutral = replace(read_neutral(args.template, system.n_vertices), parts=own)
    neutral = with_face_options(neutral, args)
    net, sources = load_network(system, args)
    manifest = write_bundle(
        net,
        args.out,
        neutral,
        sources,
        progress=not args.quiet,
        precision=args.precision,
        any_deviation=args.any_deviation,
    )
    assert manifest.parity is not None
    print(f"{args.out}: {system.name}, {sum(f.size for f in manifest.files.values()) / 1e6:.1f} MB")
    for case in manifest.parity.cases:
        print(f"  {describe_case(case)}")
    if manifest.quantisation is not None:
        print(f"  int8 against float32: {describe_deviation(manifest.quantisation)}")
    window = manifest.modes.get("window")
    if window is not None and window.deviation is not None:
        print(f"  window {window.window} against exact: {describe_deviation(window.deviation)}")
    if not neutral.given:
        print(f"{PROGRAM}: no --template: vertices are offsets from zero", file=sys.stderr)


def run_init(args: argparse.Namespace) -> None:
    """`facecode-export init`."""
    from facecode_exporter.random_weights import write_random_checkpoints

    for path in write_random_checkpoints(SYSTEMS[args.system], args.out, args.seed):
        print(path)


def run_verify(args: argparse.Namespace) -> None:
    """`facecode-export verify`."""
    from facecode.animator import Animator
    from facecode.bundle import Bundle
    from facecode_exporter.bundles import parity
    from facecode_exporter.bundles.parity_cases import parity_cases
    from facecode_exporter.bundles.writer import compare_all_graphs
    from facecode_exporter.errors import ConfigError

    animator = Animator(Bundle.open(args.bundle))
    if animator.manifest.precision != "fp32":
        raise ConfigError(
            f"{args.bundle} is {animator.manifest.precision}; verify compares float32 bundles. Its "
            "manifest states, as 'quantisation', how far it is from float32"
        )
    system = animator.manifest.system if not (args.system or args.config) else chosen_system(args)
    net, _ = load_network(system, args)
    if args.audio is None:
        for name, error in compare_all_graphs(net, animator.engine).items():
            print(f"{name}: within {error:.1e}")
        cases = list(parity_cases(net))
    else:
        cases = [_case(args, animator)]
    steps = _progress(args.quiet)
    results = [parity.compare_clip(net, animator.engine, case, steps) for case in cases]
    parity.require_parity(results)
    for result in results:
        print(parity.describe_case(result))


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `facecode-export`."""
    args = parse_args(argv)
    return guarded(PROGRAM, lambda: _with_extra(args), args.debug)


def _with_extra(args: argparse.Namespace) -> None:
    try:
        args.run(args)
    except ModuleNotFoundError as error:
        if error.name not in EXTRA_MODULES:
            raise
        raise MissingExtraError.of(args.command, str(error.name), "export") from error


def _case(args: argparse.Namespace, animator: Animator) -> Case:
    from facecode.audio import load_audio
    from facecode.loop.request import style_weights
    from facecode.options import parse_style
    from facecode_exporter.bundles.parity import Case

    style = parse_style(args.style)
    audio = load_audio(args.audio, animator.manifest.sample_rate)
    return Case(audio, style_weights(style, animator.styles))


def _progress(quiet: bool) -> Callable[[Iterable[int]], Iterable[int]]:
    from tqdm import tqdm

    return lambda steps: tqdm(steps, desc="torch", unit="frame", disable=quiet)


if __name__ == "__main__":
    sys.exit(main())
