"""The speech encoder families, by the name that a spec gives."""

from __future__ import annotations

from typing import Protocol

from torch import nn

from facecode_exporter.nets.frame_grid import frames_of
from facecode_exporter.nets.wav2vec2 import Wav2Vec2
from facecode_exporter.nets.whisper import Whisper
from facecode_spec.schema import SpeechEncoderSpec, SystemSpec


class Family(Protocol):
    """A module from audio (B, n_samples) to memory rows (B, T * rows per frame, width)."""

    def __call__(self, spec: SpeechEncoderSpec, fps: float) -> nn.Module:
        """Build the encoder with fresh weights."""

    @staticmethod
    def n_features(spec: SpeechEncoderSpec, n_samples: int) -> int:
        """Features that `n_samples` of audio give, before the frame grid."""

    @staticmethod
    def width_of(spec: SpeechEncoderSpec) -> int:
        """Width of a memory row."""


FAMILIES: dict[str, Family] = {"wav2vec2": Wav2Vec2, "whisper": Whisper}


def speech_encoder(system: SystemSpec) -> nn.Module:
    """The encoder of `system` with fresh weights."""
    return FAMILIES[system.speech_encoder.family](system.speech_encoder, system.fps)


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
