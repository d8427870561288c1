"""What the kinds of `facecode-export evaluate` do."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import facecode
from facecode.animator import Animator
from facecode.bundle import Bundle
from facecode.errors import StyleError
from facecode.writers import check_folder
from facecode_exporter.cli.options import bar, check_json, deliver

if TYPE_CHECKING:
    from facecode_exporter.data.data_set import DataSet
    from facecode_exporter.evaluation.reference import ReferenceSource
    from facecode_exporter.evaluation.speech import SpokenClip

PROGRAM = "facecode-export"
NO_REFERENCE, RULES = "none", "rules"


def run_predictions(args: argparse.Namespace) -> None:
    """`facecode-export evaluate predictions`."""
    from facecode_exporter.data.corpus_data import open_data_set
    from facecode_exporter.evaluation import distances, report
    from facecode_exporter.measures.regions import read_regions

    check_json(args.json)
    bundle = None if args.bundle is None else Bundle.open(args.bundle)
    regions = read_regions(args.lips, args.upper_face, bundle)
    data = open_data_set(args.data, args.dataset, args.split)
    found = distances.find_predictions(args.predictions, data)
    scored = list(distances.score_predictions(found, data, regions, bar("score", args.quiet)))
    plain = {"predictions": str(args.predictions), **_about(args, data)}
    plain |= report.distances_plain(scored)
    deliver(plain, report.distances_table(scored, "unit"), args.json)


def run_bundle(args: argparse.Namespace) -> None:
    """`facecode-export evaluate bundle`."""
    from facecode_exporter.data.corpus_data import open_data_set
    from facecode_exporter.evaluation import distances, report
    from facecode_exporter.measures.regions import read_regions

    check_json(args.json)
    animator = facecode.load(args.bundle, threads=args.threads)
    window = _window(args, animator)
    regions = read_regions(args.lips, args.upper_face, animator.bundle)
    data = open_data_set(args.data, args.dataset, args.split)
    styles = None if args.styles is None else _styles(args.styles, animator)
    takes = distances.takes_of(data, animator, styles)
    progress = bar("animate", args.quiet)
    scored = list(
        distances.score_animations(
            animator, takes, data, regions, progress, mode=args.mode, window=window
        )
    )
    plain = {**_about_bundle(args, animator, window), **_about(args, data)}
    plain |= report.distances_plain(scored)
    table = report.distances_table(scored, "unit")
    deliver(plain, f"{table}\n{report.codes_line(scored, animator)}", args.json)


def run_speech(args: argparse.Namespace) -> None:
    """`facecode-export evaluate speech`."""
    from facecode_exporter.data.recordings import load_aligner, read_recordings
    from facecode_exporter.evaluation import report
    from facecode_exporter.evaluation.speech import judge_speech, require_lip_pair

    check_json(args.json)
    _check_plots(args.plots)
    animator = facecode.load(args.bundle, threads=args.threads)
    window = _window(args, animator)
    pair = require_lip_pair(animator, args.lip_pair)
    styles = _styles(args.styles or animator.styles[0], animator)
    reference = _reference(args.reference, animator, pair)
    recordings, skipped = read_recordings(args.recordings, load_aligner(), bar("align", args.quiet))
    for name, reason in skipped:
        print(f"{PROGRAM}: left out {name}: {reason}", file=sys.stderr)
    progress = bar("animate", args.quiet)
    clips: list[SpokenClip] = []
    for clip in judge_speech(
        animator,
        recordings,
        styles,
        pair,
        progress,
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
    deliver(plain, report.speech_table(clips, animator.manifest.unit), args.json)


def run_diversity(args: argparse.Namespace) -> None:
    """`facecode-export evaluate diversity`: APD, UPD, LPD, MPD and ALVE."""
    from facecode_exporter.data.corpus_data import open_data_set
    from facecode_exporter.evaluation import distances, diversity, report
    from facecode_exporter.evaluation.speech import require_lip_pair
    from facecode_exporter.measures.regions import read_regions

    check_json(args.json)
    _check_plots(args.plots)
    animator = facecode.load(args.bundle, threads=args.threads)
    regions = read_regions(args.lips, args.upper_face, animator.bundle)
    data = open_data_set(args.data, args.dataset, args.split)
    takes = distances.takes_of(data, animator, None)[: args.clips]
    progress = bar("animate", args.quiet)
    scored = list(
        diversity.score_faces(
            animator, takes, data, regions, args.samples, args.hold, progress, tau=args.tau
        )
    )
    if args.plots is not None:
        take = takes[0]
        speech = data.speech(take.clip)
        faces = animator.animate(speech, take.style, samples=args.samples, mode="exact")
        pair = require_lip_pair(animator, None)
        diversity.plot_lip_distances(faces, pair, args.plots / f"{take.clip}_lip_distances.png")
    about = {"bundle": animator.manifest.name, "samples": args.samples, "hold": args.hold}
    about["tau"] = args.tau
    plain = {**about, **_about(args, data), **report.diversity_plain(scored)}
    deliver(plain, report.diversity_table(scored, animator.manifest.unit), args.json)


def run_mix(args: argparse.Namespace) -> None:
    """`facecode-export evaluate mix`: the paper's Fig. 5."""
    from facecode_exporter.evaluation.report import table
    from facecode_exporter.evaluation.speech import require_lip_pair
    from facecode_exporter.evaluation.style_mix import mix_styles, plot_mix

    check_json(args.json)
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
    deliver(plain, table(rows), args.json)


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


def _about(args: argparse.Namespace, data: DataSet) -> dict[str, Any]:
    split = args.split or data.layout.split_names[0]
    return {"data": str(args.data), "dataset": args.dataset, "split": split}


def _about_bundle(
    args: argparse.Namespace, animator: Animator, window: int | None
) -> dict[str, Any]:
    manifest = animator.manifest
    mode = {"mode": args.mode, "window": window}
    return {"bundle": manifest.name, "precision": manifest.precision, "unit": manifest.unit, **mode}


def _window(args: argparse.Namespace, animator: Animator) -> int | None:
    """Frames that are decoded at a step; None in `exact` mode."""
    window = animator.window(args.mode, args.window)
    return None if window is None else window.frames
