"""One part of the face: the cross-modal decoder over that part's VQ motion prior.

CodeTalker (section 3.2) has one part with one head. In CDFace each part is such a network whose
last layer has K heads, and a later part also reads the codes of the parts before it. `animate` is
the public algorithm, the whole prefix again at every step: slow, and what every faster path is
compared with. Attribute names are those of the public stage-2 files.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import cast

import torch
from torch import Tensor, nn

from facecode_exporter.nets.speech_decoder import Progress, SpeechDecoder, no_bar
from facecode_exporter.nets.vq_autoencoder import VQAutoencoder
from facecode_spec.schema import PartSpec, SystemSpec

Conditions = Mapping[str, Tensor]
"""Code vectors (B, n, H', C') of earlier parts, by part name."""


@dataclass(frozen=True)
class Prediction:
    """What the network says for a batch of clips, or of samples of one clip."""

    codes: Tensor
    """(B, T, H) int64"""
    offsets: Tensor
    """(B, T, V, 3), the part's own vertices"""
    features: Tensor
    """(B, T, H, C), what the codes were chosen from"""


class PartNet(SpeechDecoder):
    """Speech features and past motion to the codes and motion of one part."""

    def __init__(self, system: SystemSpec, part: PartSpec) -> None:
        super().__init__(system, part)
        decoder, (book, _) = part.cross_modal_decoder, part.prior
        # The heads of all samples side by side; one head is CodeTalker's feat_map.
        width = part.n_samples * book.codes_per_frame * book.dim
        self.feat_map = nn.Linear(decoder.dim, width, bias=False)
        self.learnable_style_emb = nn.Embedding(len(system.styles), decoder.dim)
        self.condition_map = nn.ModuleDict(
            {n: nn.Linear(code_width(system.part(n)), decoder.dim) for n in part.conditions_on}
        )
        self.autoencoder = VQAutoencoder(part, self.n_vertices)

    @property
    def style_rows(self) -> Tensor:
        """See `SpeechDecoder`."""
        return self.learnable_style_emb.weight

    @property
    def output_layer(self) -> nn.Linear:
        """See `SpeechDecoder`."""
        return self.autoencoder.decoder.vertice_map_reverse

    def tokens(self, style: Tensor, past: Tensor, conditions: Conditions) -> Tensor:
        """What the decoder reads, (B, n, D): token t holds style, frame t - 1 and conditions of t.

        Args:
            style: (B, D), rows of the style embedding or a mix of them.
            past: offsets (B, n - 1, 3V) of the part.
            conditions: code vectors of the n frames; an embedding of each part's is added to its
                token, so that self-attention over earlier tokens sees that part's past too.
        """
        tokens = self.motion_tokens(style, past)
        for name, embed in self.condition_map.items():
            tokens = tokens + embed(conditions[name][:, : tokens.shape[1]].flatten(2))
        return tokens

    def every_head(self, tokens: Tensor, memory: Tensor) -> Tensor:
        """Tokens (B, n, D) of a prefix over the clip's memory to features (B, n, K, H, C)."""
        book, _ = self.part.prior
        shape = (self.part.n_samples, book.codes_per_frame, book.dim)
        return cast(Tensor, self.feat_map(self.hidden(tokens, memory)).unflatten(-1, shape))

    def features(self, tokens: Tensor, memory: Tensor, sample: Tensor | None = None) -> Tensor:
        """`every_head`, of which head `sample[b]` answers for row b (default 0): (B, n, H, C)."""
        every = self.every_head(tokens, memory)
        row = torch.arange(len(every))
        return every[row, :, torch.zeros_like(row) if sample is None else sample]

    def offsets(self, tokens: Tensor, memory: Tensor) -> Tensor:
        """See `SpeechDecoder`; of the first head."""
        return self.decode(self.features(tokens, memory))[1]

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
        style_token = style @ self.style_rows
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
