"""Make the packaged model from a demo corpus: stage 1, stage 2, all vertices, bundle.

Every step leaves its files in the working folder and is skipped or resumed when run again.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from facecode_exporter.bundle_writer import Neutral, write_bundle
from facecode_exporter.checkpoints import save_stage1, save_system
from facecode_exporter.demo.coefficients import CorpusClips, MotionBasis, corpus_basis
from facecode_exporter.demo.head import LIP_PAIR, Head, load_head
from facecode_exporter.demo.whisper_wheel import whisper_weights
from facecode_exporter.nets.codetalker import CodeTalker
from facecode_exporter.training.config import TrainingConfig
from facecode_exporter.training.run import train
from facecode_exporter.training.stage1 import Stage1
from facecode_exporter.training.stage2 import Stage2
from facecode_spec.schema import SystemSpec
from facecode_spec.systems.codetalker_demo import SPEC

IDENTITIES = 6
"""Identities that the bundle carries, that of its template included."""
LICENCE = (
    "MIT, with parts: speech encoder from Whisper tiny.en (MIT, OpenAI); head from the MakeHuman "
    "base mesh and the Face Units pack by Mika Suominen (CC0 1.0). Trained on generated speech and "
    "procedural motion only."
)


def stage1_config(corpus: Path) -> TrainingConfig:
    """The setting of the packaged model's motion prior."""
    return TrainingConfig(
        stage="stage1",
        system=SPEC.name,
        data=corpus.name,
        epochs=40,
        learning_rate=1e-3,
        halve_every=10,
        batch_size=16,
        crop_frames=96,
        revive_codes=True,
    )


def stage2_config(corpus: Path) -> TrainingConfig:
    """The setting of the packaged model's speech-to-codes decoder."""
    return TrainingConfig(
        stage="stage2",
        system=SPEC.name,
        data=corpus.name,
        epochs=24,
        learning_rate=7e-4,
        halve_every=6,
        batch_size=16,
        crop_frames=120,
        own_history=True,
        fine_tune_speech=False,
    )


def make_demo_model(
    corpus: Path, whisper_wheel: Path, work: Path, bundle: Path, progress: bool = True
) -> None:
    """Train on `corpus` and write the bundle.

    Raises:
        CorpusError, CheckpointError, RunError, ParityError.
    """
    basis = corpus_basis(corpus)
    small = basis.system(SPEC)
    clips = {s: CorpusClips(corpus, s, basis, SPEC.styles) for s in ("train", "val")}
    net = _stage1(small, clips, stage1_config(corpus), work / "stage1", progress)
    net.audio_encoder.load_state_dict(whisper_weights(whisper_wheel))
    config = stage2_config(corpus)
    train(Stage2(net, clips["train"], clips["val"], config), config, work / "stage2", progress)
    export_demo(net, basis, work, bundle, progress)


def _stage1(
    small: SystemSpec,
    clips: dict[str, CorpusClips],
    config: TrainingConfig,
    folder: Path,
    progress: bool,
) -> CodeTalker:
    torch.manual_seed(config.seed)
    net = CodeTalker(small)
    torch.nn.init.zeros_(net.feat_map.weight)
    stage = Stage1(net.autoencoder, clips["train"], clips["val"], config)
    train(stage, config, folder, progress)
    save_stage1(net.autoencoder, folder / "stage1.pth.tar")
    return net


def export_demo(
    net: CodeTalker, basis: MotionBasis, work: Path, bundle: Path, progress: bool
) -> None:
    """Lift to all vertices, write the checkpoints in the public layout, and export."""
    full = basis.lift(net, SPEC)
    files = {stage: work / f"{stage}.pth.tar" for stage in ("stage1", "stage2")}
    save_system(full, [files["stage1"]], [files["stage2"]])
    write_bundle(full, bundle, neutral_of(load_head()), files, progress, licence=LICENCE)


def neutral_of(head: Head) -> Neutral:
    """The demo head as the face of a bundle."""
    others = list(head.identities.items())[:IDENTITIES]
    return Neutral(
        head.template,
        head.faces,
        head.colours(),
        {name: indices.astype(np.int32) for name, indices in head.regions.items()},
        LIP_PAIR,
        dict(others),
    )
