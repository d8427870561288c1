"""FaceFormer (Fan et al., CVPR 2022): speech to motion directly, frame after frame, without codes.

`animate` is the public algorithm, the whole prefix again at every step over offsets of every
vertex. Attribute names are those of the public files.
"""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn

from facecode_exporter.nets.part import Prediction
from facecode_exporter.nets.speech import speech_encoder
from facecode_exporter.nets.speech_decoder import Progress, SpeechDecoder, no_bar
from facecode_spec.schema import SystemSpec


class FaceFormer(SpeechDecoder):
    """The trained system; there is one network for the whole face."""

    def __init__(self, system: SystemSpec) -> None:
        (part,) = system.parts
        super().__init__(system, part)
        dim = part.cross_modal_decoder.dim
        self.vertice_map_r = nn.Linear(dim, 3 * self.n_vertices)
        self.obj_vector = nn.Linear(len(system.styles), dim, bias=False)
        self.audio_encoder = speech_encoder(system)

    @property
    def part_nets(self) -> tuple[FaceFormer, ...]:
        """The network of the whole face."""
        return (self,)

    @property
    def style_rows(self) -> Tensor:
        """See `SpeechDecoder`."""
        return self.obj_vector.weight.T

    @property
    def output_layer(self) -> nn.Linear:
        """See `SpeechDecoder`."""
        return self.vertice_map_r

    def memory(self, audio: Tensor) -> Tensor:
        """Normalised audio (B, n_samples) to cross-attention memory (B, T * rows, D)."""
        return cast(Tensor, self.audio_feature_map(self.audio_encoder(audio)))

    @torch.no_grad()
    def animate(self, memory: Tensor, style: Tensor, progress: Progress = no_bar) -> Prediction:
        """The step loop over a whole clip.

        Args:
            memory: cross-attention memory (B, T * rows, D).
            style: style weights (B, n_styles).
            progress: wraps the steps.
        """
        n_frames = memory.shape[1] // self.system.speech_encoder.memory_rows_per_frame
        style_token = self.obj_vector(style)
        offsets = memory.new_zeros(len(memory), 0, 3 * self.n_vertices)
        for _ in progress(range(n_frames)):
            every = self.offsets(self.motion_tokens(style_token, offsets), memory)
            offsets = torch.cat([offsets, every[:, -1:]], dim=1)
        codes = torch.zeros(*offsets.shape[:2], 0, dtype=torch.int64)
        return Prediction(codes, offsets.unflatten(-1, (self.n_vertices, 3)), codes.float())

    def offsets(self, tokens: Tensor, memory: Tensor) -> Tensor:
        """See `SpeechDecoder`."""
        return cast(Tensor, self.vertice_map_r(self.hidden(tokens, memory)))

    @torch.no_grad()
    def predict(self, audio: Tensor, style: Tensor, progress: Progress = no_bar) -> Prediction:
        """Animate normalised audio (B, n_samples) in style weights (B, n_styles)."""
        return self.animate(self.memory(audio), style, progress)
