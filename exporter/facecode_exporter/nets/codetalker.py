"""CodeTalker (CVPR 2023): the speech-driven cross-modal decoder over a VQ motion prior.

`predict` is the public algorithm, the whole prefix again at every step: slow, and what every
faster path is compared with. Attribute names are those of the public stage-2 files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import cast

import torch
from torch import Tensor, nn

from facecode_exporter.nets.sinusoid import sinusoid
from facecode_exporter.nets.speech import FAMILIES
from facecode_exporter.nets.vq_autoencoder import VQAutoencoder
from facecode_spec.schema import PartSpec, SystemSpec


@dataclass(frozen=True)
class Prediction:
    """What the network says for a batch of clips."""

    codes: Tensor
    """(B, T, H) int64"""
    offsets: Tensor
    """(B, T, V, 3)"""
    features: Tensor
    """(B, T, H, C), what the codes were chosen from"""


class CodeTalker(nn.Module):
    """The trained system; `autoencoder` holds the stage-1 weights, the rest is stage 2."""

    def __init__(self, system: SystemSpec) -> None:
        super().__init__()
        (part,) = system.parts
        self.system, self.part = system, part
        decoder, book = part.cross_modal_decoder, part.codebook
        family = FAMILIES[system.speech_encoder.family]
        self.audio_encoder = family(system.speech_encoder, system.fps)
        self.audio_feature_map = nn.Linear(family.width_of(system.speech_encoder), decoder.dim)
        self.vertice_map = nn.Linear(3 * system.n_vertices, decoder.dim)
        layer = nn.TransformerDecoderLayer(
            decoder.dim, decoder.n_heads, decoder.dim_feedforward, dropout=0.0, batch_first=True
        )
        self.transformer_decoder = nn.TransformerDecoder(layer, decoder.n_layers)
        width = book.codes_per_frame * book.dim
        self.feat_map = nn.Linear(decoder.dim, width, bias=False)
        self.learnable_style_emb = nn.Embedding(len(system.styles), decoder.dim)
        self.register_buffer(
            "position_code", sinusoid(decoder.period, decoder.dim), persistent=False
        )
        self.position_code: Tensor
        self.autoencoder = VQAutoencoder(part, system.n_vertices)

    def memory(self, audio: Tensor) -> Tensor:
        """Normalised audio (B, n_samples) to cross-attention memory (B, T * rows, D)."""
        return cast(Tensor, self.audio_feature_map(self.audio_encoder(audio)))

    def features(self, tokens: Tensor, memory: Tensor) -> Tensor:
        """Tokens (B, n, D) of a prefix over the clip's memory to features (B, n, H, C)."""
        n_frames = tokens.shape[1]
        rows = self.system.speech_encoder.memory_rows_per_frame
        period = self.part.cross_modal_decoder.period
        positions = self.position_code[torch.arange(n_frames) % period]
        hidden = self.transformer_decoder(
            tokens + positions,
            memory,
            tgt_mask=self._self_mask(n_frames).repeat(tokens.shape[0], 1, 1),
            memory_mask=cross_mask(n_frames, memory.shape[1], rows),
        )
        book = self.part.codebook
        return cast(Tensor, self.feat_map(hidden).unflatten(-1, (book.codes_per_frame, book.dim)))

    @torch.no_grad()
    def predict(
        self,
        audio: Tensor,
        style: Tensor,
        progress: Callable[[Iterable[int]], Iterable[int]] = lambda steps: steps,
    ) -> Prediction:
        """Animate normalised audio (B, n_samples) in style weights (B, n_styles)."""
        memory = self.memory(audio)
        n_frames = memory.shape[1] // self.system.speech_encoder.memory_rows_per_frame
        style_token = (style @ self.learnable_style_emb.weight)[:, None]
        tokens = style_token
        for step in progress(range(n_frames)):
            features = self.features(tokens, memory)
            if step + 1 == n_frames:
                break
            _, offsets = self._decode(features)
            fed_back = self.vertice_map(offsets[:, -1:]) + style_token
            tokens = torch.cat([tokens, fed_back], dim=1)
        codes, offsets = self._decode(features)
        return Prediction(codes, offsets.unflatten(-1, (self.system.n_vertices, 3)), features)

    def _decode(self, features: Tensor) -> tuple[Tensor, Tensor]:
        # The public code cannot decode one frame: it duplicates it and uses the first.
        if features.shape[1] > 1:
            return self.autoencoder.decode_features(features)
        codes, offsets = self.autoencoder.decode_features(features.repeat(1, 2, 1, 1))
        return codes[:, :1], offsets[:, :1]

    def _self_mask(self, n_frames: int) -> Tensor:
        return self_attention_bias(self.part, n_frames)


def alibi_slopes(n_heads: int) -> list[float]:
    """Slopes per head of Press et al. 2022 (ALiBi): 2^-2, 2^-4, 2^-6, 2^-8 for four heads."""
    if n_heads & (n_heads - 1) == 0:
        return [2.0 ** (-8.0 * (head + 1) / n_heads) for head in range(n_heads)]
    below = 1 << (n_heads.bit_length() - 1)
    return alibi_slopes(below) + alibi_slopes(2 * below)[0::2][: n_heads - below]


def self_attention_bias(part: PartSpec, n_frames: int) -> Tensor:
    """Causal mask plus -floor((t - j) / period) * slope: (heads, n_frames, n_frames)."""
    decoder = part.cross_modal_decoder
    frame = torch.arange(n_frames)
    distance = frame[:, None] - frame
    steps = torch.div(distance, decoder.period, rounding_mode="floor")
    slopes = torch.tensor(alibi_slopes(decoder.n_heads))
    bias = -steps * slopes[:, None, None]
    return bias.masked_fill(distance < 0, float("-inf"))


def cross_mask(n_frames: int, n_rows: int, rows_per_frame: int) -> Tensor:
    """True where frame t may not look: it sees memory rows [t * rows, (t + 1) * rows)."""
    owner = torch.arange(n_rows) // rows_per_frame
    return owner != torch.arange(n_frames)[:, None]
