"""`facecode-export evaluate`: score predictions, a bundle, or lip sync without captured motion."""

from __future__ import annotations

import argparse
from pathlib import Path

from facecode.audio import SPEECH
from facecode.bundle import PACKAGED_BUNDLE
from facecode.cli.options import Commands, add_debug, add_mode, add_quiet
from facecode_exporter.cli import evaluate_live, evaluate_people, evaluate_quiet
from facecode_exporter.cli import evaluate_runs as runs
from facecode_exporter.cli.options import add_json, add_threads, count, vertex_pair
from facecode_exporter.data.data_set import LAYOUTS


def add_parser(commands: Commands) -> None:
    """The sub-command `evaluate` with its kinds, each with `run` set."""
    evaluate = commands.add_parser("evaluate", help="score motion against truth, or lip sync")
    kinds = evaluate.add_subparsers(dest="kind", required=True)
    for add in (
        _add_predictions,
        _add_bundle,
        _add_speech,
        evaluate_live.add,
        evaluate_quiet.add,
        _add_diversity,
        _add_mix,
        evaluate_people.add,
    ):
        kind = add(kinds)
        add_json(kind)
        add_debug(kind)
        add_quiet(kind)


def _add_predictions(kinds: Commands) -> argparse.ArgumentParser:
    predictions = kinds.add_parser("predictions", help="files of vertices against captured faces")
    predictions.set_defaults(run=runs.run_predictions)
    predictions.add_argument(
        "predictions", type=Path, metavar="PREDICTIONS", help="a folder of .npy or .npz"
    )
    _add_data(predictions)
    predictions.add_argument("--bundle", type=Path, metavar="DIR", help="whose regions to use")
    return predictions


def _add_bundle(kinds: Commands) -> argparse.ArgumentParser:
    bundle = kinds.add_parser("bundle", help="a bundle's motion against captured faces")
    bundle.set_defaults(run=runs.run_bundle)
    bundle.add_argument("bundle", type=Path, metavar="DIR", help="the bundle")
    _add_data(bundle)
    _add_animation(bundle, "own style of the subject where there is one, else all")
    return bundle


def _add_speech(kinds: Commands) -> argparse.ArgumentParser:
    speech = kinds.add_parser("speech", help="lip sync on recordings with their words")
    speech.set_defaults(run=runs.run_speech)
    speech.add_argument("recordings", type=Path, metavar="RECORDINGS", help="wav or flac with .txt")
    speech.add_argument(
        "--bundle",
        type=Path,
        metavar="DIR",
        default=PACKAGED_BUNDLE,
        help="default: the packaged one",
    )
    _add_animation(speech, "the bundle's first")
    speech.add_argument(
        "--samples", type=count, metavar="K", help="judge K faces, as <style>-<face> (default: 1)"
    )
    speech.add_argument("--lip-pair", type=vertex_pair, metavar="U,L", help="default: the bundle's")
    speech.add_argument(
        "--reference",
        default=runs.RULES,
        metavar="DIR",
        help=f"motion to compare with: a folder of <name>.npz, {runs.RULES} "
        f"(default), {runs.NO_REFERENCE}",
    )
    speech.add_argument("--plots", type=Path, metavar="DIR", help="a picture of each clip")
    return speech


def _add_diversity(kinds: Commands) -> argparse.ArgumentParser:
    diversity = kinds.add_parser("diversity", help="how different several faces of a voice are")
    diversity.set_defaults(run=runs.run_diversity)
    diversity.add_argument("bundle", type=Path, metavar="DIR", help="the bundle")
    _add_data(diversity)
    diversity.add_argument("--samples", type=count, default=5, metavar="K", help="default: 5")
    diversity.add_argument("--hold", metavar="PART", help="keep its first sample, vary the rest")
    diversity.add_argument(
        "--tau", type=float, metavar="TAU", help="baseline: a model of one sample draws its codes"
    )
    diversity.add_argument("--clips", type=count, metavar="N", help="the first N; default: all")
    diversity.add_argument("--plots", type=Path, metavar="DIR", help="lip distances of the samples")
    add_threads(diversity)
    return diversity


def _add_mix(kinds: Commands) -> argparse.ArgumentParser:
    mix = kinds.add_parser("mix", help="how wide the mouth opens between two styles")
    mix.set_defaults(run=runs.run_mix)
    mix.add_argument("--styles", required=True, metavar="A,B", help="two names")
    mix.add_argument(
        "--bundle",
        type=Path,
        metavar="DIR",
        default=PACKAGED_BUNDLE,
        help="default: the packaged one",
    )
    mix.add_argument("--audio", type=Path, metavar="FILE", default=SPEECH, help="the packaged one")
    mix.add_argument("--lip-pair", type=vertex_pair, metavar="U,L", help="default: the bundle's")
    mix.add_argument("--plot", type=Path, metavar="PNG", help="the curves")
    add_threads(mix)
    return mix


def _add_data(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--data", type=Path, required=True, metavar="DIR", help="the captured faces"
    )
    parser.add_argument("--dataset", choices=sorted(LAYOUTS), required=True, help="what DIR holds")
    splits = "; ".join(f"{n}: {', '.join(v.split_names)}" for n, v in LAYOUTS.items())
    parser.add_argument("--split", help=f"{splits} (default: the first)")
    for name in ("lips", "upper-face"):
        parser.add_argument(
            f"--{name}", type=Path, metavar="FILE", help="vertex indices; default: the bundle's"
        )


def _add_animation(parser: argparse.ArgumentParser, default: str) -> None:
    parser.add_argument("--styles", metavar="A,B", help=f"names, or all; default: {default}")
    add_mode(parser)
    add_threads(parser)
