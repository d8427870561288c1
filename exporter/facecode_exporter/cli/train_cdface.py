"""`facecode-export train` for CDFace: the motion prior and the query network of one part."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path
from typing import Any

from facecode_exporter.checkpoints import (
    load_encoder,
    load_part,
    load_stage1,
)
from facecode_exporter.cli.options import divided, require_speech_encoder
from facecode_exporter.data.clips import FolderClips, FolderPart
from facecode_exporter.errors import RunError
from facecode_exporter.face_parts import variant
from facecode_exporter.nets.cdface import CDFace
from facecode_exporter.nets.part import PartNet
from facecode_exporter.nets.speech import family_of
from facecode_exporter.training import recipes
from facecode_exporter.training.config import TrainingConfig, cdface_defaults, stage1_defaults
from facecode_exporter.training.diverse_losses import DiverseLosses
from facecode_exporter.training.heads import start_from_one
from facecode_exporter.training.speech_weights import load_pretrained
from facecode_spec.schema import SystemSpec


def run_part(
    args: argparse.Namespace, system: SystemSpec, layout: str, chosen: dict[str, Any]
) -> Path:
    """Train what `args` names of one part and return the checkpoint.

    Raises:
        RegionError, DataSetError, RunError, CheckpointError.
    """
    _check(args, system)
    system, vertices = divided(system, args)
    name = args.part.replace("-", "_")
    pair = args.lip_pair or (0, 0)
    train_clips, val_clips = (
        FolderPart(FolderClips(args.data, layout, s, system), vertices[name], pair)
        for s in ("train", "validation")
    )
    about = (system.name, str(args.data))
    vocaset = layout == "vocaset"
    clips, progress = (train_clips, val_clips), not args.quiet
    if args.stage == "stage1":
        config = dataclasses.replace(stage1_defaults(*about, vocaset), part=name, **chosen)
        net = recipes.seeded(config, lambda: PartNet(system, system.part(name)))
        return recipes.train_prior(net.autoencoder, clips, config, args.out, progress)
    config = dataclasses.replace(cdface_defaults(*about, name, vocaset), **chosen)
    config = dataclasses.replace(config, losses=DiverseLosses(mask=not args.no_mask))
    query_net = recipes.seeded(config, lambda: CDFace(system))
    _load(args, query_net, config)
    return recipes.train_query(query_net, clips, config, args.out, progress)


def _load(args: argparse.Namespace, net: CDFace, config: TrainingConfig) -> None:
    """The weights that the part begins with."""
    first, part = net.part_nets[0], net.part_net(str(config.part))
    load_stage1(part.autoencoder, args.stage1)
    if part is not first:
        load_part(first, *args.earlier)
        load_encoder(net.audio_encoder, args.earlier[1])
    elif args.start is None:
        require_speech_encoder(args)
        if args.speech_encoder is not None:
            load_pretrained(net.audio_encoder, family_of(net.system), args.speech_encoder)
    if args.start is not None:
        _start(args, net, part, config)


def _start(args: argparse.Namespace, net: CDFace, part: PartNet, config: TrainingConfig) -> None:
    """All heads from the one head of --start, and the first part's speech encoder."""
    one = CDFace(variant(net.system, 1, upper_first=False)).part_net(part.part.name)
    load_part(one, args.stage1, args.start)
    start_from_one(part, one, config.head_spread)
    if part is net.part_nets[0]:
        load_encoder(net.audio_encoder, args.start)


def _check(args: argparse.Namespace, system: SystemSpec) -> None:
    """Refuse options that lack something, before anything is read.

    Raises:
        RunError
    """
    if system.family != "cdface" or args.part is None or args.stage == "stage2":
        raise RunError(
            f"got stage {args.stage} of {system.name} with --part {args.part}; a CDFace system is "
            "trained by `train stage1 --part P`, then `train cdface --part P`, lips and upper-face"
        )
    if args.stage == "stage1":
        return
    if args.stage1 is None:
        raise RunError("cdface needs --stage1, the motion prior of the part")
    if args.lip_pair is None:
        raise RunError(
            "cdface needs --lip-pair UPPER,LOWER: frames with a closed mouth are found so"
        )
    is_first = (args.part == "upper-face") == args.upper_first
    if is_first != (args.earlier is None):
        raise RunError(
            "--earlier STAGE1 STAGE2 names the part before, and goes with the second part alone; "
            f"{args.part} is the {'first' if is_first else 'second'}"
        )
