"""The public loop on one clip: from end to end, or one step at a chosen prefix length."""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor

from facecode.arrays import Audio
from facecode.level import normalise
from facecode_exporter.nets.networks import Network
from facecode_exporter.nets.speech_decoder import SpeechDecoder


class PublicAlgorithm:
    """Every part of the face one after the other, its whole prefix again at every step."""

    def __init__(self, net: Network, speech: Audio) -> None:
        audio = normalise(speech) if net.system.speech_encoder.normalise else speech
        self._net, self._audio = net, torch.from_numpy(audio)[None]
        self._memories = self.encode()
        rows = net.system.speech_encoder.memory_rows_per_frame
        self.n_frames = self._memories[0].shape[1] // rows

    @torch.no_grad()
    def encode(self) -> list[Tensor]:
        """The cross-attention memory of every part."""
        encoded = self._net.audio_encoder(self._audio)
        return [part.audio_feature_map(encoded) for part in self._net.part_nets]

    @torch.no_grad()
    def step(self, n_prefix: int) -> None:
        """One step with `n_prefix` tokens, any tokens: times do not depend on them."""
        for part, memory in zip(self._net.part_nets, self._memories, strict=True):
            tokens = torch.zeros(1, n_prefix, part.part.cross_modal_decoder.dim)
            _step(part, tokens, memory)

    @torch.no_grad()
    def run(self) -> None:
        """The whole clip from end to end."""
        for part, memory in zip(self._net.part_nets, self.encode(), strict=True):
            style = part.style_rows[:1, None]
            tokens = style
            for _ in range(self.n_frames):
                tokens = torch.cat([tokens, _step(part, tokens, memory) + style], dim=1)


def _step(part: SpeechDecoder, tokens: Tensor, memory: Tensor) -> Tensor:
    """Tokens (1, n, D) to the embedding (1, 1, D) of the motion of the last frame."""
    return cast(Tensor, part.vertice_map(part.offsets(tokens, memory)[:, -1:]))
