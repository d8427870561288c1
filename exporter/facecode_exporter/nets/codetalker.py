"""CodeTalker (CVPR 2023): the speech-driven cross-modal decoder over a VQ motion prior."""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor

from facecode_exporter.nets.part import PartNet, Prediction
from facecode_exporter.nets.speech import speech_encoder
from facecode_exporter.nets.speech_decoder import Progress, no_bar
from facecode_spec.schema import SystemSpec


class CodeTalker(PartNet):
    """The trained system; `autoencoder` holds the stage-1 weights, the rest is stage 2."""

    def __init__(self, system: SystemSpec) -> None:
        (part,) = system.parts
        super().__init__(system, part)
        self.audio_encoder = speech_encoder(system)

    @property
    def part_nets(self) -> tuple[PartNet, ...]:
        """The network of the whole face."""
        return (self,)

    def memory(self, audio: Tensor) -> Tensor:
        """Normalised audio (B, n_samples) to cross-attention memory (B, T * rows, D)."""
        return cast(Tensor, self.audio_feature_map(self.audio_encoder(audio)))

    @torch.no_grad()
    def predict(self, audio: Tensor, style: Tensor, progress: Progress = no_bar) -> Prediction:
        """Animate normalised audio (B, n_samples) in style weights (B, n_styles)."""
        return self.animate(self.memory(audio), style, progress=progress)
