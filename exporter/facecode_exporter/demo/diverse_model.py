"""Make the packaged diverse model from a demo corpus: per part a motion prior and a query network.

Every step leaves its files in the working folder and is skipped or resumed when run again.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import torch

from facecode_exporter.bundles.writer import write_bundle
from facecode_exporter.checkpoints import save_system
from facecode_exporter.corpus.files import load_corpus_head
from facecode_exporter.demo.coefficients import CorpusClips, MotionBasis, corpus_basis, rounded
from facecode_exporter.demo.model import LICENCE, neutral_of
from facecode_exporter.demo.whisper_wheel import whisper_weights
from facecode_exporter.face_parts import variant
from facecode_exporter.head.division import part_vertices
from facecode_exporter.head.head import load_head
from facecode_exporter.nets.cdface import CDFace
from facecode_exporter.nets.part import PartNet
from facecode_exporter.training.config import TrainingConfig
from facecode_exporter.training.diverse_losses import DiverseLosses
from facecode_exporter.training.heads import sort_heads, start_from_one
from facecode_exporter.training.query import QueryStage
from facecode_exporter.training.run import train
from facecode_exporter.training.speech_rows import SpeechRows
from facecode_exporter.training.stage1 import Stage1
from facecode_spec.schema import SystemSpec
from facecode_spec.systems.cdface_demo import SPEC

Bases = Mapping[str, MotionBasis]


PRIOR_EPOCHS = {"lips": 32, "upper_face": 24}
"""Of the motion priors; the learning rate is halved at each quarter."""


def stage1_config(corpus: Path, part: str) -> TrainingConfig:
    """The setting of a part's motion prior."""
    return TrainingConfig(
        stage="stage1",
        system=SPEC.name,
        data=corpus.name,
        epochs=PRIOR_EPOCHS[part],
        part=part,
        learning_rate=1e-3,
        halve_every=PRIOR_EPOCHS[part] // 4,
        batch_size=16,
        crop_frames=96,
        revive_codes=True,
    )


ONE_EPOCHS = {"lips": (20, 5), "upper_face": (4, 2)}
EPOCHS = {"lips": (6, 2), "upper_face": (5, 2)}
"""Of the query networks, with one sample and then with all, and after how many of them the learning
rate is halved."""
LOSSES = {
    "lips": DiverseLosses(),
    # Nothing that one hears says what the upper face does: its samples may differ more.
    "upper_face": DiverseLosses(half_at=0.8, every_sample=0.06),
}


def one_config(corpus: Path, part: str) -> TrainingConfig:
    """The setting of a part's query network with one sample, from which the others start."""
    epochs, halve_every = ONE_EPOCHS[part]
    return TrainingConfig(
        stage="cdface",
        system=SPEC.name,
        data=corpus.name,
        epochs=epochs,
        part=part,
        learning_rate=7e-4,
        halve_every=halve_every,
        batch_size=8,
        crop_frames=90,
        speech_dropout=0.2,
        losses=DiverseLosses(every_sample=0.2),
        fine_tune_speech=False,
    )


def query_config(corpus: Path, part: str) -> TrainingConfig:
    """The setting of a part's query network with all samples."""
    epochs, halve_every = EPOCHS[part]
    return dataclasses.replace(
        one_config(corpus, part),
        epochs=epochs,
        halve_every=halve_every,
        crop_frames=60,
        losses=LOSSES[part],
    )


def make_diverse_model(
    corpus: Path, whisper_wheel: Path, work: Path, bundle: Path, progress: bool = True
) -> None:
    """Train on `corpus` and write the bundle.

    Raises:
        CorpusError, CheckpointError, RunError, ParityError.
    """
    net, bases = train_diverse(SPEC, corpus, whisper_wheel, work, progress)
    export_diverse(net, bases, SPEC, work, bundle, progress)


def corpus_bases(corpus: Path) -> Bases:
    """The basis of each part's motion."""
    vertices = part_vertices(load_corpus_head(corpus))
    return {name: corpus_basis(corpus, own) for name, own in vertices.items()}


def on_coefficients(full: SystemSpec, bases: Bases) -> SystemSpec:
    """`full` on coefficients in place of vertices."""
    parts = tuple(
        dataclasses.replace(part, n_vertices=bases[part.name].n_vertices) for part in full.parts
    )
    n_vertices = sum(basis.n_vertices for basis in bases.values())
    return dataclasses.replace(full, n_vertices=n_vertices, parts=parts)


def train_diverse(
    full: SystemSpec, corpus: Path, whisper_wheel: Path, work: Path, progress: bool = True
) -> tuple[CDFace, Bases]:
    """The trained network on coefficients, and the bases that lift it to vertices.

    Raises:
        CorpusError, CheckpointError, RunError.
    """
    bases = corpus_bases(corpus)
    torch.manual_seed(0)
    net = CDFace(on_coefficients(full, bases))
    net.audio_encoder.load_state_dict(whisper_weights(whisper_wheel))
    for part in net.part_nets:
        train_prior(part, bases[part.part.name], corpus, work, progress)
    one = with_priors_of(net, variant(net.system, 1, upper_first=False))
    speech = None
    for name, basis in bases.items():
        stage = query_stage(one, one_config(corpus, name), basis, corpus, speech)
        train(stage, stage.config, work / f"{name}-one", progress)
        speech = stage.speech
    stages: dict[str, QueryStage] = {}
    for name, basis in bases.items():
        config = query_config(corpus, name)
        start_from_one(net.part_net(name), one.part_net(name), config.head_spread)
        stages[name] = query_stage(net, config, basis, corpus, speech)
        train(stages[name], config, work / f"{name}-query", progress)
    torch.manual_seed(0)
    errors = {name: stages[name].head_errors() for name in bases}
    for name in bases:
        sort_heads(net.part_net(name), errors[name])
    return net, bases


def with_priors_of(net: CDFace, system: SystemSpec) -> CDFace:
    """A fresh network of `system` with the speech encoder and the motion priors of `net`."""
    torch.manual_seed(0)
    other = CDFace(system)
    other.audio_encoder.load_state_dict(net.audio_encoder.state_dict())
    for part in net.part_nets:
        own = other.part_net(part.part.name)
        own.autoencoder.load_state_dict(part.autoencoder.state_dict())
    return other


def query_stage(
    net: CDFace,
    config: TrainingConfig,
    basis: MotionBasis,
    corpus: Path,
    speech: SpeechRows | None = None,
) -> QueryStage:
    """Stage 2 of the part `config.part`; `speech`: speech that a stage before has encoded."""
    clips = corpus_clips(corpus, basis)
    return QueryStage(net, clips["train"], clips["val"], config, speech)


def train_prior(net: PartNet, basis: MotionBasis, corpus: Path, work: Path, progress: bool) -> None:
    """Stage 1 of one part."""
    name = net.part.name
    clips, config = corpus_clips(corpus, basis), stage1_config(corpus, name)
    stage = Stage1(net.autoencoder, clips["train"], clips["val"], config)
    train(stage, config, work / f"{name}-stage1", progress)


def corpus_clips(corpus: Path, basis: MotionBasis) -> dict[str, CorpusClips]:
    """Training and validation clips of one part."""
    return {split: CorpusClips(corpus, split, basis, SPEC.styles) for split in ("train", "val")}


def lifted(net: CDFace, bases: Bases, full: SystemSpec) -> CDFace:
    """The network on all vertices; its weights are float16 values."""
    wide = CDFace(full)
    wide.audio_encoder.load_state_dict(rounded(net.audio_encoder.state_dict()))
    for small, part in zip(net.part_nets, wide.part_nets, strict=True):
        part.load_state_dict(rounded(bases[part.part.name].lifted(small.state_dict())))
    return wide.eval()


def export_diverse(
    net: CDFace, bases: Bases, full: SystemSpec, work: Path, bundle: Path, progress: bool
) -> None:
    """Lift to all vertices, write the checkpoints in the public layout, and export."""
    wide = lifted(net, bases, full)
    names = [f"{stage}_{part.name}" for stage in ("stage1", "stage2") for part in full.parts]
    files = {name: work / f"{name}.pth.tar" for name in names}
    paths = list(files.values())
    save_system(wide, paths[: len(full.parts)], paths[len(full.parts) :])
    head = load_head()
    neutral = dataclasses.replace(neutral_of(head), parts=part_vertices(head))
    write_bundle(wide, bundle, neutral, files, progress, licence=LICENCE)
