"""The transformer decoder from speech and past motion to hidden frames, which all systems share.

FaceFormer (Fan et al., CVPR 2022) defines it; CodeTalker takes it over with more layers and puts a
choice of codes behind it. Attribute names are those of the public files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import cast

import torch
from torch import Tensor, nn

from facecode_exporter.nets.sinusoid import sinusoid
from facecode_exporter.nets.speech import family_of
from facecode_spec.schema import PartSpec, SystemSpec

Progress = Callable[[Iterable[int]], Iterable[int]]


def no_bar(steps: Iterable[int]) -> Iterable[int]:
    """The steps as they are."""
    return steps


class SpeechDecoder(nn.Module):
    """Speech features and past motion to hidden frames; what is made of them is a subclass's."""

    def __init__(self, system: SystemSpec, part: PartSpec) -> None:
        super().__init__()
        self.system, self.part = system, part
        decoder = part.cross_modal_decoder
        self.n_vertices = system.vertices_of(part)
        width = family_of(system).width_of(system.speech_encoder)
        self.audio_feature_map = nn.Linear(width, decoder.dim)
        self.vertice_map = nn.Linear(3 * self.n_vertices, decoder.dim)
        layer = nn.TransformerDecoderLayer(
            decoder.dim, decoder.n_heads, decoder.dim_feedforward, dropout=0.0, batch_first=True
        )
        self.transformer_decoder = nn.TransformerDecoder(layer, decoder.n_layers)
        self.register_buffer(
            "position_code", sinusoid(decoder.period, decoder.dim), persistent=False
        )
        self.position_code: Tensor
        self.token_dropout = nn.Dropout(0.0)

    def drop(self, share: float) -> None:
        """Drop this share, in training, of the tokens and within the decoder's layers."""
        for module in (self.token_dropout, *self.transformer_decoder.modules()):
            if isinstance(module, nn.Dropout):
                module.p = share
            elif isinstance(module, nn.MultiheadAttention):
                module.dropout = share

    @property
    def style_rows(self) -> Tensor:
        """The vector of each style, (S, D)."""
        raise NotImplementedError

    @property
    def output_layer(self) -> nn.Linear:
        """From hidden frames to offsets (3V)."""
        raise NotImplementedError

    def offsets(self, tokens: Tensor, memory: Tensor) -> Tensor:
        """Tokens (B, n, D) of a prefix over the clip's memory to its offsets (B, n, 3V)."""
        raise NotImplementedError

    def motion_tokens(self, style: Tensor, past: Tensor) -> Tensor:
        """Tokens (B, n, D): the style, and from frame 1 on the frame before it.

        Args:
            style: (B, D), rows of `style_rows` or a mix of them.
            past: offsets (B, n - 1, 3V) of the part.
        """
        fed_back = self.vertice_map(past) + style[:, None]
        return torch.cat([style[:, None], fed_back], dim=1)

    def hidden(self, tokens: Tensor, memory: Tensor) -> Tensor:
        """Tokens (B, n, D) of a prefix over the clip's memory to (B, n, D)."""
        n_frames = tokens.shape[1]
        rows = self.system.speech_encoder.memory_rows_per_frame
        period = self.part.cross_modal_decoder.period
        positions = self.position_code[torch.arange(n_frames) % period]
        hidden = self.transformer_decoder(
            self.token_dropout(tokens + positions),
            memory,
            tgt_mask=self_attention_bias(self.part, n_frames).repeat(tokens.shape[0], 1, 1),
            memory_mask=cross_mask(n_frames, memory.shape[1], rows),
        )
        return cast(Tensor, hidden)


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
