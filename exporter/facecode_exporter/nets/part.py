"""One part of the face: the cross-modal decoder over that part's VQ motion prior.

CodeTalker (section 3.2) has one part with one head. In CDFace each part is such a network whose
last layer has K heads, and a later part also reads the codes of the parts before it. `animate` is
the public algorithm, the whole prefix again at every step: slow, and what every faster path is
compared with. Attribute names are those of the public stage-2 files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import cast

import torch
from torch import Tensor, nn

from facecode_exporter.nets.sinusoid import sinusoid
from facecode_exporter.nets.speech import family_of
from facecode_exporter.nets.vq_autoencoder import VQAutoencoder
from facecode_spec.schema import PartSpec, SystemSpec

Conditions = Mapping[str, Tensor]
"""Code vectors (B, n, H', C') of earlier parts, by part name."""
Progress = Callable[[Iterable[int]], Iterable[int]]


@dataclass(frozen=True)
class Prediction:
    """What the network says for a batch of clips, or of samples of one clip."""

    codes: Tensor
    """(B, T, H) int64"""
    offsets: Tensor
    """(B, T, V, 3), the part's own vertices"""
    features: Tensor
    """(B, T, H, C), what the codes were chosen from"""


def no_bar(steps: Iterable[int]) -> Iterable[int]:
    """The steps as they are."""
    return steps


class PartNet(nn.Module):
    """Speech features and past motion to the codes and motion of one part."""

    def __init__(self, system: SystemSpec, part: PartSpec) -> None:
        super().__init__()
        self.system, self.part = system, part
        decoder, (book, _) = part.cross_modal_decoder, part.prior
        self.n_vertices = system.vertices_of(part)
        width = family_of(system).width_of(system.speech_encoder)
        self.audio_feature_map = nn.Linear(width, decoder.dim)
        self.vertice_map = nn.Linear(3 * self.n_vertices, decoder.dim)
        layer = nn.TransformerDecoderLayer(
            decoder.dim, decoder.n_heads, decoder.dim_feedforward, dropout=0.0, batch_first=True
        )
        self.transformer_decoder = nn.TransformerDecoder(layer, decoder.n_layers)
        # The heads of all samples side by side; one head is CodeTalker's feat_map.
        width = part.n_samples * book.codes_per_frame * book.dim
        self.feat_map = nn.Linear(decoder.dim, width, bias=False)
        self.learnable_style_emb = nn.Embedding(len(system.styles), decoder.dim)
        self.condition_map = nn.ModuleDict(
            {n: nn.Linear(code_width(system.part(n)), decoder.dim) for n in part.conditions_on}
        )
        self.register_buffer(
            "position_code", sinusoid(decoder.period, decoder.dim), persistent=False
        )
        self.position_code: Tensor
        self.autoencoder = VQAutoencoder(part, self.n_vertices)

    def tokens(self, style: Tensor, past: Tensor, conditions: Conditions) -> Tensor:
        """What the decoder reads, (B, n, D): token t holds style, frame t - 1 and conditions of t.

        Args:
            style: (B, D), rows of the style embedding or a mix of them.
            past: offsets (B, n - 1, 3V) of the part.
            conditions: code vectors of the n frames; an embedding of each part's is added to its
                token, so that self-attention over earlier tokens sees that part's past too.
        """
        fed_back = self.vertice_map(past) + style[:, None]
        tokens = torch.cat([style[:, None], fed_back], dim=1)
        for name, embed in self.condition_map.items():
            tokens = tokens + embed(conditions[name][:, : tokens.shape[1]].flatten(2))
        return tokens

    def every_head(self, tokens: Tensor, memory: Tensor) -> Tensor:
        """Tokens (B, n, D) of a prefix over the clip's memory to features (B, n, K, H, C)."""
        n_frames = tokens.shape[1]
        rows = self.system.speech_encoder.memory_rows_per_frame
        period = self.part.cross_modal_decoder.period
        positions = self.position_code[torch.arange(n_frames) % period]
        hidden = self.transformer_decoder(
            tokens + positions,
            memory,
            tgt_mask=self_attention_bias(self.part, n_frames).repeat(tokens.shape[0], 1, 1),
            memory_mask=cross_mask(n_frames, memory.shape[1], rows),
        )
        book, _ = self.part.prior
        shape = (self.part.n_samples, book.codes_per_frame, book.dim)
        return cast(Tensor, self.feat_map(hidden).unflatten(-1, shape))

    def features(self, tokens: Tensor, memory: Tensor, sample: Tensor | None = None) -> Tensor:
        """`every_head`, of which head `sample[b]` answers for row b (default 0): (B, n, H, C)."""
        every = self.every_head(tokens, memory)
        row = torch.arange(len(every))
        return every[row, :, torch.zeros_like(row) if sample is None else sample]

    @torch.no_grad()
    def animate(
        self,
        memory: Tensor,
        style: Tensor,
        sample: Tensor | None = None,
        conditions: Conditions | None = None,
        progress: Progress = no_bar,
    ) -> Prediction:
        """The step loop over a whole clip.

        Args:
            memory: cross-attention memory (B, T * rows, D).
            style: style weights (B, n_styles).
            sample: head for each row, (B,) int64; the first by default.
            conditions: code vectors (B, T, H', C') of the parts that this one conditions on.
            progress: wraps the steps.
        """
        n_frames = memory.shape[1] // self.system.speech_encoder.memory_rows_per_frame
        style_token = style @ self.learnable_style_emb.weight
        past = memory.new_zeros(len(memory), 0, 3 * self.n_vertices)
        for step in progress(range(n_frames)):
            tokens = self.tokens(style_token, past, conditions or {})
            features = self.features(tokens, memory, sample)
            if step + 1 < n_frames:
                _, offsets = self.decode(features)
                past = torch.cat([past, offsets[:, -1:]], dim=1)
        codes, offsets = self.decode(features)
        return Prediction(codes, offsets.unflatten(-1, (self.n_vertices, 3)), features)

    @torch.no_grad()
    def held(self, codes: Tensor) -> Prediction:
        """The motion of given codes (B, T, H) in place of predicted ones."""
        features = self.autoencoder.quantize.look_up(codes)
        _, offsets = self.decode(features)
        return Prediction(codes, offsets.unflatten(-1, (self.n_vertices, 3)), features)

    def decode(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Features (B, n, H, C) to codes (B, n, H) and offsets (B, n, 3V); n may be 1."""
        # The public code cannot decode one frame: it duplicates it and uses the first.
        if features.shape[1] > 1:
            return self.autoencoder.decode_features(features)
        codes, offsets = self.autoencoder.decode_features(features.repeat(1, 2, 1, 1))
        return codes[:, :1], offsets[:, :1]


def code_width(part: PartSpec) -> int:
    """Numbers in the code vectors of one frame."""
    book, _ = part.prior
    return book.codes_per_frame * book.dim


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
