"""The public loop on one clip: from end to end, or one step at a chosen prefix length."""

from __future__ import annotations

import torch
from torch import Tensor

from facecode.arrays import Audio
from facecode.audio import normalise
from facecode_exporter.nets.codetalker import CodeTalker


class PublicAlgorithm:
    """The public loop on one clip, whole or one step at a chosen prefix length."""

    def __init__(self, net: CodeTalker, speech: Audio) -> None:
        heard = normalise(speech) if net.system.speech_encoder.normalise else speech
        self._net, self._audio = net, torch.from_numpy(heard)[None]
        self._style = torch.eye(len(net.system.styles))[:1]
        self._memory = self.encode()
        self.n_frames = self._memory.shape[1] // net.system.speech_encoder.memory_rows_per_frame

    @torch.no_grad()
    def encode(self) -> Tensor:
        """The cross-attention memory."""
        return self._net.memory(self._audio)

    @torch.no_grad()
    def step(self, n_prefix: int) -> None:
        """What `CodeTalker.predict` does at the step with `n_prefix` tokens (any tokens)."""
        tokens = torch.zeros(1, n_prefix, self._net.part.cross_modal_decoder.dim)
        features = self._net.features(tokens, self._memory)
        _, offsets = self._net.autoencoder.decode_features(features)
        self._net.vertice_map(offsets[:, -1:])

    def run(self) -> None:
        """The whole clip from end to end."""
        self._net.predict(self._audio, self._style)
