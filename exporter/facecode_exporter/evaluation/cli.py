"""`facecode-export evaluate`: score predictions, a bundle, or lip sync without captured motion.

Plugs into the exporter's command line with `add_parser(commands)`.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import facecode
from facecode.animator import Animator
from facecode.audio import SPEECH
from facecode.bundle import PACKAGED_BUNDLE, Bundle
from facecode.errors import StyleError
from facecode.request import MODES, window_frames
from facecode.writers.atomic import check_folder, writing
from facecode_exporter.evaluation.data_set import LAYOUTS

if TYPE_CHECKING:
    from facecode_exporter.evaluation.data_set import DataSet
    from facecode_exporter.evaluation.reference import ReferenceSource
    from facecode_exporter.evaluation.speech import SpokenClip

    Commands = argparse._SubParsersAction[argparse.ArgumentParser]

PROGRAM = "facecode-export"
STANDARD_STREAM = "-"
NO_REFERENCE, RULES = "none", "rules"
T = TypeVar("T")


def add_parser(commands: Commands) -> None:
    """The sub-command `evaluate` with its kinds, each with `run` set."""
    evaluate = commands.add_parser("evaluate", help="score motion against truth, or lip sync")
    kinds = evaluate.add_subparsers(dest="kind", required=True)

    predictions = kinds.add_parser("predictions", help="files of vertices against captured faces")
    predictions.set_defaults(run=run_predictions)
    predictions.add_argument("predictions", type=Path, metavar="PREDICTIONS")
    _add_data(predictions)
    predictions.add_argument("--bundle", type=Path, metavar="DIR", help="whose regions to use")

    bundle = kinds.add_parser("bundle", help="a bundle's motion against captured faces")
    bundle.set_defaults(run=run_bundle)
    bundle.add_argument("bundle", type=Path, metavar="DIR")
    _add_data(bundle)
    _add_animation(bundle, "own style of the subject where there is one, else all")

    speech = kinds.add_parser("speech", help="lip sync on recordings with their words")
    speech.set_defaults(run=run_speech)
    speech.add_argument("recordings", type=Path, metavar="RECORDINGS", help="wav or flac with .txt")
    speech.add_argument("--bundle", type=Path, metavar="DIR", default=PACKAGED_BUNDLE)
    _add_animation(speech, "the bundle's first")
    speech.add_argument(
        "--samples", type=_count, metavar="K", help="judge K faces, as <style>-<face> (default: 1)"
    )
    speech.add_argument("--lip-pair", type=vertex_pair, metavar="U,L", help="default: the bundle's")
    speech.add_argument(
        "--reference",
        default=RULES,
        metavar="DIR",
        help=f"motion to compare with: a folder of <name>.npz, {RULES} (default), {NO_REFERENCE}",
    )
    speech.add_argument("--plots", type=Path, metavar="DIR", help="a picture of each clip")

    diversity = kinds.add_parser("diversity", help="how different several faces of a voice are")
    diversity.set_defaults(run=run_diversity)
    diversity.add_argument("bundle", type=Path, metavar="DIR")
    _add_data(diversity)
    diversity.add_argument("--samples", type=_count, default=5, metavar="K", help="default: 5")
    diversity.add_argument("--hold", metavar="PART", help="keep its first sample, vary the rest")
    diversity.add_argument(
        "--tau", type=float, metavar="TAU", help="baseline: a model of one sample draws its codes"
    )
    diversity.add_argument("--clips", type=_count, metavar="N", help="the first N; default: all")
    diversity.add_argument("--plots", type=Path, metavar="DIR", help="lip distances of the samples")
    diversity.add_argument("--threads", type=_count, metavar="N", help="default: all cores")

    mix = kinds.add_parser("mix", help="how wide the mouth opens between two styles")
    mix.set_defaults(run=run_mix)
    mix.add_argument("--styles", required=True, metavar="A,B", help="two names")
    mix.add_argument("--bundle", type=Path, metavar="DIR", default=PACKAGED_BUNDLE)
    mix.add_argument("--audio", type=Path, metavar="FILE", default=SPEECH, help="the packaged one")
    mix.add_argument("--lip-pair", type=vertex_pair, metavar="U,L", help="default: the bundle's")
    mix.add_argument("--plot", type=Path, metavar="PNG", help="the curves")
    mix.add_argument("--threads", type=_count, metavar="N", help="default: all cores")

    for kind in (predictions, bundle, speech, diversity, mix):
        kind.add_argument("--json", metavar="FILE", help="write the numbers to FILE, or -")
        kind.add_argument("--debug", action="store_true", help="show the traceback of errors")
        kind.add_argument("--quiet", action="store_true", help="no progress")


def run_predictions(args: argparse.Namespace) -> None:
    """`facecode-export evaluate predictions`."""
    from facecode_exporter.evaluation import distances, report
    from facecode_exporter.evaluation.corpus_data import open_data_set
    from facecode_exporter.evaluation.regions import read_regions

    _check_json(args.json)
    bundle = None if args.bundle is None else Bundle.open(args.bundle)
    regions = read_regions(args.lips, args.upper_face, bundle)
    data = open_data_set(args.data, args.dataset, args.split)
    found = distances.find_predictions(args.predictions, data)
    scored = list(distances.score_predictions(found, data, regions, _bar("score", args.quiet)))
    plain = {"predictions": str(args.predictions), **_about(args, data)}
    plain |= report.distances_plain(scored)
    _deliver(plain, report.distances_table(scored, "unit"), args.json)


def run_bundle(args: argparse.Namespace) -> None:
    """`facecode-export evaluate bundle`."""
    from facecode_exporter.evaluation import distances, report
    from facecode_exporter.evaluation.corpus_data import open_data_set
    from facecode_exporter.evaluation.regions import read_regions

    window_frames(args.mode, args.window)  # before anything is loaded
    _check_json(args.json)
    animator = facecode.load(args.bundle, threads=args.threads)
    window = animator.window_frames(args.mode, args.window)
    regions = read_regions(args.lips, args.upper_face, animator.bundle)
    data = open_data_set(args.data, args.dataset, args.split)
    styles = None if args.styles is None else _styles(args.styles, animator)
    takes = distances.takes_of(data, animator, styles)
    bar = _bar("animate", args.quiet)
    scored = list(
        distances.score_animations(
            *(animator, takes, data, regions, bar), mode=args.mode, window=window
        )
    )
    plain = {**_about_bundle(args, animator, window), **_about(args, data)}
    plain |= report.distances_plain(scored)
    table = report.distances_table(scored, "unit")
    _deliver(plain, f"{table}\n{report.codes_line(scored, animator)}", args.json)


def run_speech(args: argparse.Namespace) -> None:
    """`facecode-export evaluate speech`."""
    from facecode_exporter.evaluation import report
    from facecode_exporter.evaluation.recordings import load_aligner, read_recordings
    from facecode_exporter.evaluation.speech import judge_speech, require_lip_pair

    window_frames(args.mode, args.window)  # before anything is loaded
    _check_json(args.json)
    _check_plots(args.plots)
    animator = facecode.load(args.bundle, threads=args.threads)
    window = animator.window_frames(args.mode, args.window)
    pair = require_lip_pair(animator, args.lip_pair)
    styles = _styles(args.styles or animator.styles[0], animator)
    reference = _reference(args.reference, animator, pair)
    recordings, skipped = read_recordings(
        args.recordings, load_aligner(), _bar("align", args.quiet)
    )
    for name, reason in skipped:
        print(f"{PROGRAM}: left out {name}: {reason}", file=sys.stderr)
    bar = _bar("animate", args.quiet)
    clips: list[SpokenClip] = []
    for clip in judge_speech(
        *(animator, recordings, styles, pair, bar),
        reference=reference,
        mode=args.mode,
        window=window,
        samples=args.samples,
    ):
        clips.append(clip)
        _plot(clip, args.plots)
    plain = {
        **_about_bundle(args, animator, window),
        "recordings": str(args.recordings),
        "reference": args.reference,
        "lip_pair": list(pair),
        "seconds": round(sum(r.duration_s for r in recordings), 3),
        "left_out": dict(skipped),
        **report.speech_plain(clips),
    }
    _deliver(plain, report.speech_table(clips, animator.manifest.unit), args.json)


def run_diversity(args: argparse.Namespace) -> None:
    """`facecode-export evaluate diversity`: APD, UPD, LPD, MPD and ALVE."""
    from facecode_exporter.evaluation import distances, diversity, report
    from facecode_exporter.evaluation.corpus_data import open_data_set
    from facecode_exporter.evaluation.regions import read_regions
    from facecode_exporter.evaluation.speech import require_lip_pair

    _check_json(args.json)
    _check_plots(args.plots)
    animator = facecode.load(args.bundle, threads=args.threads)
    regions = read_regions(args.lips, args.upper_face, animator.bundle)
    data = open_data_set(args.data, args.dataset, args.split)
    takes = distances.takes_of(data, animator, None)[: args.clips]
    bar = _bar("animate", args.quiet)
    scored = list(
        diversity.score_faces(
            *(animator, takes, data, regions, args.samples, args.hold, bar), tau=args.tau
        )
    )
    if args.plots is not None:
        take = takes[0]
        faces = animator.animate(data.speech(take.clip), take.style, samples=args.samples)
        pair = require_lip_pair(animator, None)
        diversity.plot_lip_distances(faces, pair, args.plots / f"{take.clip}_lip_distances.png")
    about = {"bundle": animator.manifest.name, "samples": args.samples, "hold": args.hold}
    about["tau"] = args.tau
    plain = {**about, **_about(args, data), **report.diversity_plain(scored)}
    _deliver(plain, report.diversity_table(scored, animator.manifest.unit), args.json)


def run_mix(args: argparse.Namespace) -> None:
    """`facecode-export evaluate mix`: the paper's Fig. 5."""
    from facecode_exporter.evaluation.report import table
    from facecode_exporter.evaluation.speech import require_lip_pair
    from facecode_exporter.evaluation.style_mix import mix_styles, plot_mix

    _check_json(args.json)
    if args.plot is not None:
        _check_plots(args.plot.parent)
    animator = facecode.load(args.bundle, threads=args.threads)
    styles = _styles(args.styles, animator)
    if len(styles) != 2:
        raise StyleError(f"got {len(styles)} styles; expected two, as in --styles calm,lively")
    pair = require_lip_pair(animator, args.lip_pair)
    mix = mix_styles(animator, args.audio, (styles[0], styles[1]), pair)
    if args.plot is not None:
        plot_mix(mix, args.plot)
    rows = [(f"share of {styles[1]}", f"mean opening ({animator.manifest.unit})")]
    rows += [(f"{s:.2f}", f"{m:.4g}") for s, m in zip(mix.shares, mix.means, strict=True)]
    plain = {"styles": list(styles), "shares": list(mix.shares), "means": list(mix.means)}
    _deliver(plain, table(rows), args.json)


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
    parser.add_argument("--mode", choices=MODES, default="exact")
    parser.add_argument("--window", type=_count, metavar="W", help="frames (window mode)")
    parser.add_argument("--threads", type=_count, metavar="N", help="default: all cores")


def _styles(text: str, animator: Animator) -> Sequence[str]:
    known = animator.styles
    names = known if text == "all" and "all" not in known else text.split(",")
    if unknown := [name for name in names if name not in known]:
        raise StyleError(f"got style {', '.join(unknown)}; this bundle has {', '.join(known)}")
    return names


def _reference(text: str, animator: Animator, pair: tuple[int, int]) -> ReferenceSource:
    from facecode_exporter.evaluation.reference import from_folder, from_rules

    if text == NO_REFERENCE:
        return lambda _, __: None
    return from_rules(animator) if text == RULES else from_folder(Path(text), animator, pair)


def _plot(clip: SpokenClip, folder: Path | None) -> None:
    if folder is not None:
        from facecode_exporter.evaluation.plots import plot_opening

        plot_opening(clip, folder / f"{clip.recording.name}_{clip.style}.png")


def _check_plots(folder: Path | None) -> None:
    if folder is not None:
        from facecode_exporter.evaluation.plots import require_matplotlib

        require_matplotlib()
        check_folder(folder / "clip.png")


def _check_json(file: str | None) -> None:
    if file not in (None, STANDARD_STREAM):
        check_folder(Path(file))


def _about(args: argparse.Namespace, data: DataSet) -> dict[str, Any]:
    split = args.split or data.layout.split_names[0]
    return {"data": str(args.data), "dataset": args.dataset, "split": split}


def _about_bundle(
    args: argparse.Namespace, animator: Animator, window: int | None
) -> dict[str, Any]:
    manifest = animator.manifest
    mode = {"mode": args.mode, "window": window}
    return {"bundle": manifest.name, "precision": manifest.precision, "unit": manifest.unit, **mode}


def _deliver(plain: dict[str, Any], table: str, file: str | None) -> None:
    numbers = json.dumps(plain, indent=1, allow_nan=False)
    if file == STANDARD_STREAM:
        print(numbers)
        return
    print(table)
    if file is not None:
        with writing(Path(file)) as output:
            output.write(f"{numbers}\n".encode())


def _bar(what: str, quiet: bool) -> Callable[[Sequence[T]], Iterable[T]]:
    from tqdm import tqdm

    return lambda work: tqdm(work, desc=what, unit="clip", disable=quiet)


def _count(text: str) -> int:
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a positive whole number, got {text}")
    return int(text)


def vertex_pair(text: str) -> tuple[int, int]:
    """UPPER,LOWER as argparse reads it."""
    upper, _, lower = text.partition(",")
    if not (upper.isdigit() and lower.isdigit()):
        raise argparse.ArgumentTypeError(f"expected UPPER,LOWER vertex indices, got {text}")
    return int(upper), int(lower)
