"""How each stage is trained: seed, network, weights to begin with, loop, checkpoint.

Functions of plain arguments; command lines and the recipes of the packaged models call them.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import torch
from torch import nn

from facecode_exporter.checkpoints import load_stage1, save_stage1, save_stage2
from facecode_exporter.data.clips import Clips, PartClips
from facecode_exporter.faceformer_checkpoint import save_faceformer
from facecode_exporter.nets.cdface import CDFace
from facecode_exporter.nets.codetalker import CodeTalker
from facecode_exporter.nets.faceformer import FaceFormer
from facecode_exporter.nets.vq_autoencoder import VQAutoencoder
from facecode_exporter.training.config import TrainingConfig
from facecode_exporter.training.faceformer import FaceFormerStage
from facecode_exporter.training.query import QueryStage
from facecode_exporter.training.run import train
from facecode_exporter.training.stage1 import Stage1
from facecode_exporter.training.stage2 import Stage2
from facecode_spec.schema import SystemSpec

STAGE1_FILE, STAGE2_FILE = "stage1.pth.tar", "stage2.pth.tar"
FACEFORMER_FILE = "faceformer.pth"
Net = TypeVar("Net", bound=nn.Module)
ClipPair = tuple[Clips, Clips]
"""Clips to learn from, and clips to validate on."""


def seeded(config: TrainingConfig, make: Callable[[], Net]) -> Net:
    """A fresh network, its weights drawn from the seed of `config`."""
    torch.manual_seed(config.seed)
    return make()


def train_prior(
    net: VQAutoencoder, clips: ClipPair, config: TrainingConfig, folder: Path, progress: bool
) -> Path:
    """Train a motion prior (stage 1) and write its checkpoint into `folder`.

    Raises:
        RunError
    """
    if config.small_codebook:
        net.quantize.shrink(config.seed)
    train(Stage1(net, *clips, config), config, folder, progress)
    file = folder / STAGE1_FILE
    save_stage1(net, file)
    return file


def train_codetalker(
    system: SystemSpec,
    prior: Path,
    clips: ClipPair,
    config: TrainingConfig,
    folder: Path,
    load_speech: Callable[[nn.Module], object] | None = None,
    progress: bool = False,
) -> CodeTalker:
    """Train speech to codes (stage 2) over the motion prior in the file `prior`.

    Args:
        system: a system of one part.
        prior: checkpoint of stage 1.
        clips: to learn from and to validate on.
        config: of the run.
        folder: of the run; a run that was interrupted goes on there.
        load_speech: puts pretrained weights into the speech encoder.
        progress: show a bar on stderr.

    Raises:
        CheckpointError, RunError.
    """
    net = seeded(config, lambda: CodeTalker(system))
    nn.init.zeros_(net.feat_map.weight)
    load_stage1(net.autoencoder, prior)
    if load_speech is not None:
        load_speech(net.audio_encoder)
    train(Stage2(net, *clips, config), config, folder, progress)
    return net


def train_faceformer(
    system: SystemSpec,
    clips: ClipPair,
    config: TrainingConfig,
    folder: Path,
    load_speech: Callable[[nn.Module], object] | None = None,
    progress: bool = False,
) -> Path:
    """Train FaceFormer and write its checkpoint into `folder`; arguments as of `train_codetalker`.

    Raises:
        RunError
    """
    net = seeded(config, lambda: FaceFormer(system))
    nn.init.zeros_(net.vertice_map_r.weight)
    nn.init.zeros_(net.vertice_map_r.bias)
    if load_speech is not None:
        load_speech(net.audio_encoder)
    train(FaceFormerStage(net, *clips, config), config, folder, progress)
    save_faceformer(net, folder / FACEFORMER_FILE)
    return folder / FACEFORMER_FILE


def train_query(
    net: CDFace,
    clips: tuple[PartClips, PartClips],
    config: TrainingConfig,
    folder: Path,
    progress: bool,
) -> Path:
    """Train the query network of the part `config.part` and write its checkpoint into `folder`.

    Raises:
        RunError
    """
    train(QueryStage(net, *clips, config), config, folder, progress)
    file = folder / STAGE2_FILE
    save_stage2(net.part_net(str(config.part)), net.audio_encoder, file)
    return file
