"""What a training run does, saved beside its results as config.json."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from facecode.writers import writing
from facecode_exporter.errors import ConfigError
from facecode_exporter.training.diverse_losses import DiverseLosses
from facecode_spec.plain import SpecError, from_plain, to_plain

CONFIG_FILE = "config.json"


@dataclass(frozen=True)
class TrainingConfig:
    """Defaults are the paper's (section 3.3), or the public code's where it is silent."""

    stage: Literal["stage1", "stage2", "cdface", "faceformer"]
    system: str
    data: str
    epochs: int
    part: str | None = None
    """Which part of the face is trained; null: the only one."""
    seed: int = 0
    learning_rate: float = 1e-4
    halve_every: int | None = None
    """Epochs after which the learning rate is halved; null: constant."""
    weight_decay: float = 0.0
    batch_size: int = 1
    crop_frames: int | None = None
    """Longest stretch of a clip that a batch sees; null: whole clips."""
    commitment: float = 0.25
    """Stage 1: weight of the commitment term."""
    position_dropout: float = 0.0
    """Stage 1: share dropped, in training, behind the position constants of encoder and decoder."""
    small_codebook: bool = False
    """Stage 1: code vectors begin uniformly within +-1/N, as in the public code; else normal, of
    variance 1."""
    revive_codes: bool = False
    """Stage 1: codes that an epoch did not use restart at features of the data. Not in the paper;
    keeps a codebook in use when the data is small."""
    reg_weight: float = 1.0
    """Stage 2: weight of the feature term."""
    motion_weight: float = 1.0
    """Stage 2: weight of the vertex term."""
    own_history: bool = False
    """Stage 2: in place of the true past, half of the clips see none and the others see what the
    network says without one. Not in the paper; a small network that is taught on the true past
    learns to go on with it rather than to listen."""
    speech_dropout: float = 0.0
    """Stage 2 and cdface: share of the speech features that are dropped in training. Not in the
    paper; keeps a decoder that has heard few voices from leaning on what is theirs alone."""
    mask_share: float = 0.0
    """Share of the frames that SpecAugment hides from a trained wav2vec 2.0."""
    layer_drop: float = 0.0
    """Chance of each layer of a trained wav2vec 2.0 to be left out."""
    encoder_dropout: float = 0.0
    """Share dropped in front of the layers of a trained wav2vec 2.0."""
    aligned_speech: bool = False
    """Speech is brought to the frames of the motion, as the public code trains: stretched to them
    (VOCASET) or cut to them before the transformer hears it (BIWI). Else it is heard as in use, and
    motion and speech are cut to the shorter one; wav2vec 2.0 only."""
    streamed_share: float = 0.0
    """Every stage that hears speech: share of the training clips that are heard as a stream hears
    them, each under a plan of its own; see `streamed_rows`. Not in the papers."""
    closed_weight: float = 1.0
    """Stage 2: how many times a frame counts in which the true mouth is closed. Not in the paper;
    short closures are few frames, and a mean over all leaves them half open."""
    teacher_forcing: bool = False
    """FaceFormer: it sees the true past in place of its own."""
    decoder_dropout: float = 0.0
    """Share dropped, in training, of the decoder's tokens and within its layers."""
    losses: DiverseLosses | None = None
    """cdface: weights and shapes of its terms."""
    head_spread: float = 1.5
    """cdface that starts from a network of one head: noise on the copies of that head, as a share
    of the root mean square of its weights. Copies alone would never part; after 0.5 they part
    slowly, for the push at a distance is in proportion to it."""
    fine_tune_speech: bool = True
    """Stage 2, and cdface's first part: train the speech encoder's transformer too; its
    convolutions stay frozen."""

    def save(self, folder: Path) -> None:
        """Write config.json into `folder`."""
        with writing(folder / CONFIG_FILE) as file:
            file.write(f"{json.dumps(to_plain(self), indent=1)}\n".encode())

    @classmethod
    def load(cls, folder: Path) -> TrainingConfig:
        """Read config.json.

        Raises:
            ConfigError
        """
        try:
            return from_plain(cls, json.loads((folder / CONFIG_FILE).read_text()))
        except (OSError, ValueError, SpecError) as error:
            raise ConfigError(f"{folder / CONFIG_FILE} cannot be used: {error}") from error


PUBLISHED_SPEECH: Mapping[str, Any] = {
    "decoder_dropout": 0.1,
    "mask_share": 0.05,
    "layer_drop": 0.1,
    "encoder_dropout": 0.1,
    "aligned_speech": True,
}
"""What the public code of CodeTalker and FaceFormer does to speech and decoder in training."""


def stage1_defaults(system: str, data: str, vocaset: bool) -> TrainingConfig:
    """The published setting of stage 1."""
    return TrainingConfig(
        stage="stage1",
        system=system,
        data=data,
        epochs=200,
        halve_every=20 if vocaset else None,
        weight_decay=0.01,  # AdamW's default, which the public code leaves
        position_dropout=0.1,
        small_codebook=True,
    )


def stage2_defaults(system: str, data: str) -> TrainingConfig:
    """The published setting of stage 2."""
    return TrainingConfig(stage="stage2", system=system, data=data, epochs=100, **PUBLISHED_SPEECH)


def faceformer_defaults(system: str, data: str) -> TrainingConfig:
    """The published setting of FaceFormer."""
    return TrainingConfig(
        stage="faceformer", system=system, data=data, epochs=100, **PUBLISHED_SPEECH
    )


def cdface_defaults(system: str, data: str, part: str, vocaset: bool) -> TrainingConfig:
    """The published setting of CDFace's query networks, as far as its prose fixes one."""
    return TrainingConfig(
        stage="cdface",
        system=system,
        data=data,
        epochs=50 if vocaset else 100,
        part=part,
        weight_decay=0.01,  # AdamW's default
        losses=DiverseLosses(),
    )
