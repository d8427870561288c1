"""Options that name a system and the checkpoint files of it, and what they load."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from facecode_exporter.cli.options import published, system_name
from facecode_spec.graphs import part_file
from facecode_spec.schema import SystemSpec
from facecode_spec.systems import SYSTEMS

if TYPE_CHECKING:
    from facecode_exporter.nets.networks import Network


def add_files(parser: argparse.ArgumentParser) -> None:
    """`--stage1`, `--stage2` and `--checkpoint`."""
    for stage, what in (("stage1", "the VQ autoencoder"), ("stage2", "the speech decoder")):
        parser.add_argument(
            f"--{stage}",
            type=Path,
            nargs="+",
            metavar="FILE",
            help=f"the public .pth.tar of {what}; of systems of several parts, one for each",
        )
    parser.add_argument(
        "--checkpoint", type=Path, metavar="FILE", help="FaceFormer: the one file that it has"
    )


def add_checkpoints(parser: argparse.ArgumentParser, system_required: bool) -> None:
    """Which system, and its files."""
    add_files(parser)
    which = parser.add_mutually_exclusive_group(required=system_required)
    which.add_argument(
        "--system", type=system_name(SYSTEMS), metavar="NAME", help=published(SYSTEMS)
    )
    which.add_argument("--config", type=Path, metavar="YAML", help="the public configuration")
    parser.add_argument(
        "--wav2vec2-config",
        "--speech-encoder-config",
        type=Path,
        metavar="JSON",
        help="the speech encoder's Hugging Face config.json (default: the published one)",
    )


def chosen_system(args: argparse.Namespace) -> SystemSpec:
    """The system that `--system` or `--config` names.

    Raises:
        ConfigError
    """
    from facecode_exporter.config import system_from_config, with_encoder_config

    if args.config is not None:
        return system_from_config(args.config, args.wav2vec2_config)
    system = SYSTEMS[args.system]
    if args.wav2vec2_config is None:
        return system
    return with_encoder_config(system, args.wav2vec2_config)


def load_network(system: SystemSpec, args: argparse.Namespace) -> tuple[Network, dict[str, Path]]:
    """The trained system of the files that were given, and those files by name.

    Raises:
        CheckpointError: files that do not go with `system`.
        CheckpointNotFoundError
    """
    from facecode_exporter.checkpoints import load_system
    from facecode_exporter.errors import CheckpointError
    from facecode_exporter.faceformer_checkpoint import load_faceformer

    stages = (args.stage1, args.stage2)
    if system.family == "faceformer":
        if args.checkpoint is None or stages != (None, None):
            raise CheckpointError(f"{system.name} is one file; give --checkpoint FILE alone")
        return load_faceformer(system, args.checkpoint), {"checkpoint": args.checkpoint}
    if args.checkpoint is not None or None in stages:
        raise CheckpointError(
            f"{system.name} is two files for each part; give --stage1 FILE and --stage2 FILE, "
            "without --checkpoint"
        )
    sources = {
        part_file(system, part, stage): path
        for stage, files in zip(("stage1", "stage2"), stages, strict=True)
        for part, path in zip(system.parts, files, strict=False)
    }
    return load_system(system, *stages), sources
