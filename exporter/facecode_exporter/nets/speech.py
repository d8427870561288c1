"""The speech encoder families, by the name that a spec gives."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from torch import Tensor, nn
from transformers import PreTrainedConfig

from facecode_exporter.nets.frame_grid import frames_of
from facecode_exporter.nets.wav2vec2 import Wav2Vec2
from facecode_exporter.nets.whisper import Whisper
from facecode_spec.schema import SpeechEncoderSpec, SystemSpec


class Family(Protocol):
    """A module from audio (B, n_samples) to memory rows (B, T * rows per frame, width)."""

    @property
    def hugging_face(self) -> type[PreTrainedConfig]:
        """The class of its config.json."""

    @property
    def frozen(self) -> tuple[str, ...]:
        """Prefixes of the weights that training leaves alone."""

    @property
    def kept_float(self) -> tuple[str, ...]:
        """Parts of names of the weights that int8 leaves alone."""

    def __call__(self, spec: SpeechEncoderSpec, fps: float) -> nn.Module:
        """Build the encoder with fresh weights."""

    @staticmethod
    def n_features(spec: SpeechEncoderSpec, n_samples: int) -> int:
        """Features that `n_samples` of audio give, before the frame grid."""

    @staticmethod
    def width_of(spec: SpeechEncoderSpec) -> int:
        """Width of a memory row."""

    @staticmethod
    def pretrained(folder: Path) -> dict[str, Tensor]:
        """Weights of a local Hugging Face folder, under the names of the module."""

    @staticmethod
    def for_export(encoder: nn.Module) -> nn.Module:
        """The encoder in the form that becomes a graph, with the same weights and results."""


FAMILIES: dict[str, Family] = {"wav2vec2": Wav2Vec2, "whisper": Whisper}


def family_of(system: SystemSpec) -> Family:
    """The family of the speech encoder of `system`."""
    return FAMILIES[system.speech_encoder.family]


def speech_encoder(system: SystemSpec) -> nn.Module:
    """The encoder of `system` with fresh weights."""
    return family_of(system)(system.speech_encoder, system.fps)


def n_frames(spec: SpeechEncoderSpec, fps: float, n_samples: int) -> int:
    """Frames that `n_samples` of audio give; 0 when the audio is too short for one."""
    return frames_of(FAMILIES[spec.family].n_features(spec, n_samples), spec, fps)


def samples_for(spec: SpeechEncoderSpec, fps: float, frames: int) -> int:
    """The shortest audio, in samples, that gives at least `frames` frames."""
    low, high = 0, spec.sample_rate
    while n_frames(spec, fps, high) < frames:
        high *= 2
    while high - low > 1:
        middle = (low + high) // 2
        if n_frames(spec, fps, middle) >= frames:
            high = middle
        else:
            low = middle
    return high
