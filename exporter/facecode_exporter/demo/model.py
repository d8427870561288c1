"""Make the packaged model from a demo corpus: stage 1, stage 2, all vertices, bundle.

Every step leaves its files in the working folder and is skipped or resumed when run again.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from facecode.clip import Rig
from facecode_exporter.bundles.neutral import Neutral
from facecode_exporter.bundles.writer import write_bundle
from facecode_exporter.checkpoints import save_system
from facecode_exporter.demo.coefficients import CorpusClips, MotionBasis, corpus_basis
from facecode_exporter.demo.whisper_wheel import whisper_weights
from facecode_exporter.head.face_units import FACE_UNITS
from facecode_exporter.head.head import LIP_PAIR, Head, load_head
from facecode_exporter.nets.codetalker import CodeTalker
from facecode_exporter.training import recipes
from facecode_exporter.training.config import TrainingConfig
from facecode_spec.systems.codetalker_demo import SPEC

IDENTITIES = 6
"""Identities that the bundle carries, that of its template included."""
LICENCE = (
    "MIT, with parts: speech encoder from Whisper tiny.en (MIT, OpenAI); head from the MakeHuman "
    "base mesh and the Face Units pack by Mika Suominen (CC0 1.0). Trained on generated speech and "
    "on speech and tracked lips of speaker s1 of the GRID corpus (Cooke, Barker, Cunningham and "
    "Shao 2006, CC BY 4.0); neither voice nor face is to be presented as that person's."
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
        epochs=12,
        learning_rate=7e-4,
        halve_every=4,
        batch_size=16,
        crop_frames=120,
        own_history=True,
        speech_dropout=0.2,
        streamed_share=0.5,
        closed_weight=2.5,
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
    prior = train_prior(corpus, basis, stage1_config(corpus), work / "stage1", progress)
    run = work / "stage2"
    net = train_speech(corpus, basis, prior, whisper_wheel, stage2_config(corpus), run, progress)
    full = basis.lift(net, SPEC)
    files = save_demo(full, work)
    write_bundle(full, bundle, neutral_of(load_head()), files, progress, licence=LICENCE)


def train_prior(
    corpus: Path, basis: MotionBasis, config: TrainingConfig, folder: Path, progress: bool
) -> Path:
    """Stage 1 on coefficients; gives its checkpoint.

    Raises:
        CorpusError, RunError.
    """
    net = recipes.seeded(config, lambda: CodeTalker(basis.system(SPEC)))
    clips = _clips(corpus, basis)
    return recipes.train_prior(net.autoencoder, clips, config, folder, progress)


def train_speech(
    corpus: Path,
    basis: MotionBasis,
    prior: Path,
    whisper_wheel: Path,
    config: TrainingConfig,
    folder: Path,
    progress: bool,
) -> CodeTalker:
    """Stage 2 on coefficients over the stage 1 in the file `prior`.

    Raises:
        CorpusError, CheckpointError, RunError.
    """
    weights = whisper_weights(whisper_wheel)
    return recipes.train_codetalker(
        basis.system(SPEC),
        prior,
        _clips(corpus, basis),
        config,
        folder,
        lambda encoder: encoder.load_state_dict(weights),
        progress,
    )


def _clips(corpus: Path, basis: MotionBasis) -> tuple[CorpusClips, CorpusClips]:
    """What the networks learn from and are validated on."""
    return (
        CorpusClips(corpus, "train", basis, SPEC.styles),
        CorpusClips(corpus, "val", basis, SPEC.styles),
    )


def save_demo(full: CodeTalker, folder: Path) -> dict[str, Path]:
    """Write the checkpoints of the network on all vertices, in the public layout."""
    files = {"stage1": folder / recipes.STAGE1_FILE, "stage2": folder / recipes.STAGE2_FILE}
    save_system(full, [files["stage1"]], [files["stage2"]])
    return files


def neutral_of(head: Head) -> Neutral:
    """The demo head as the face of a bundle."""
    others = list(head.identities.items())[:IDENTITIES]
    return Neutral(
        vertices=head.template,
        faces=head.faces,
        colours=head.colours(),
        regions={name: indices.astype(np.int32) for name, indices in head.regions.items()},
        lip_pair=LIP_PAIR,
        identities=dict(others),
        rig=Rig(tuple(FACE_UNITS), head.unit_offsets),
    )
