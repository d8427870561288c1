"""The VQ autoencoder of facial motion (CodeTalker, section 3.1): offsets to codes and back.

Receives offsets (B, T, 3V), or code features (B, T, H, C). Attribute names are those of the
public checkpoints (`encoder.squasher.0.0.weight`, ...), so a state dict loads as it is.
"""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn

from facecode_exporter.nets.pre_norm import Transformer
from facecode_exporter.nets.sinusoid import sinusoid
from facecode_spec.schema import PartSpec


class ClipNorm(nn.Module):
    """Instance norm over the T frames at hand, (B, E, T); one frame gives zero.

    Written out, since torch refuses one frame and an exported InstanceNorm1d must not
    carry statistics.
    """

    def __init__(self, dim: int, affine: bool, eps: float = 1e-5) -> None:
        super().__init__()
        self.eps = eps
        self.weight = nn.Parameter(torch.ones(dim)) if affine else None
        self.bias = nn.Parameter(torch.zeros(dim)) if affine else None

    def forward(self, x: Tensor) -> Tensor:
        """(B, E, T) to (B, E, T)."""
        centred = x - x.mean(dim=-1, keepdim=True)
        normed = centred * torch.rsqrt(centred.square().mean(dim=-1, keepdim=True) + self.eps)
        if self.weight is None or self.bias is None:
            return normed
        return normed * self.weight[:, None] + self.bias[:, None]


class Net(nn.Module):
    """A linear layer under the name `net`, as the public files have it."""

    def __init__(self, n_in: int, n_out: int) -> None:
        super().__init__()
        self.net = nn.Linear(n_in, n_out)

    def forward(self, x: Tensor) -> Tensor:
        """(..., n_in) to (..., n_out)."""
        return cast(Tensor, self.net(x))


CONVOLUTION = {"encoder": "squasher", "decoder": "expander"}
"""Public names of the temporal convolution."""


class TemporalTrunk(nn.Module):
    """What encoder and decoder share: convolution, norm, linear, constant, transformer."""

    def __init__(self, part: PartSpec, side: str) -> None:
        super().__init__()
        _, spec = part.prior
        self.side = side
        dim = spec.dim
        convolution = nn.Sequential(
            nn.Conv1d(dim, dim, spec.kernel, padding=spec.kernel // 2, padding_mode="replicate"),
            nn.LeakyReLU(spec.negative_slope),
            ClipNorm(dim, spec.norm_affine),
        )
        self.add_module(CONVOLUTION[side], nn.Sequential(convolution))
        self.add_module(f"{side}_linear_embedding", Net(dim, dim))
        self.add_module(
            f"{side}_transformer",
            Transformer(dim, spec.n_layers, spec.n_heads, spec.dim_feedforward),
        )
        # The public module indexes its position table by batch: every frame gets row 0.
        self.register_buffer("constant", sinusoid(1, dim)[0], persistent=False)
        self.constant: Tensor
        self.position_dropout = nn.Dropout(0.0)

    @property
    def transformer(self) -> Transformer:
        """The transformer under its public name."""
        return cast(Transformer, getattr(self, f"{self.side}_transformer"))

    def before_transformer(self, x: Tensor) -> Tensor:
        """(B, T, E) to (B, T, E): convolution, norm over the clip, linear layer, constant."""
        convolution = self.get_submodule(CONVOLUTION[self.side])
        x = convolution(x.transpose(1, 2)).transpose(1, 2)
        x = getattr(self, f"{self.side}_linear_embedding")(x) + self.constant
        return cast(Tensor, self.position_dropout(x))


class VQEncoder(TemporalTrunk):
    """Offsets (B, T, 3V) to features (B, T, H, C); used in training only."""

    def __init__(self, part: PartSpec, n_vertices: int) -> None:
        super().__init__(part, "encoder")
        book, spec = part.prior
        self.vertice_mapping = nn.Sequential(
            nn.Linear(3 * n_vertices, spec.dim), nn.LeakyReLU(spec.negative_slope)
        )
        self.code_shape = (book.codes_per_frame, book.dim)
        if spec.input_projection:
            self.encoder_linear_embedding_post = Net(spec.dim, book.codes_per_frame * book.dim)

    def forward(self, offsets: Tensor) -> Tensor:
        """Offsets (B, T, 3V) to features (B, T, H, C)."""
        x = self.transformer(self.before_transformer(self.vertice_mapping(offsets)))
        if hasattr(self, "encoder_linear_embedding_post"):
            x = self.encoder_linear_embedding_post(x)
        return cast(Tensor, x.unflatten(-1, self.code_shape))


class VQDecoder(TemporalTrunk):
    """Code vectors (B, T, H, C) to hidden frames (B, T, E) and offsets (B, T, 3V)."""

    def __init__(self, part: PartSpec, n_vertices: int) -> None:
        super().__init__(part, "decoder")
        book, spec = part.prior
        if spec.input_projection:
            self.decoder_linear_embedding_pre = Net(book.codes_per_frame * book.dim, spec.dim)
        self.vertice_map_reverse = nn.Linear(spec.dim, 3 * n_vertices, bias=spec.output_bias)

    def embed(self, vectors: Tensor) -> Tensor:
        """Code vectors (B, T, H, C) to the transformer's input (B, T, E)."""
        x = vectors.flatten(2)
        if hasattr(self, "decoder_linear_embedding_pre"):
            x = cast(Tensor, self.decoder_linear_embedding_pre(x))
        return self.before_transformer(x)

    def forward(self, vectors: Tensor) -> Tensor:
        """Code vectors (B, T, H, C) to offsets (B, T, 3V)."""
        hidden = self.transformer(self.embed(vectors))
        return cast(Tensor, self.vertice_map_reverse(hidden))


class Quantizer(nn.Module):
    """Nearest codebook row by squared distance."""

    def __init__(self, n_codes: int, dim: int) -> None:
        super().__init__()
        self.embedding = nn.Embedding(n_codes, dim)

    def forward(self, features: Tensor) -> Tensor:
        """Features (..., C) to codes (...) int64; the lower code wins a tie."""
        rows = self.embedding.weight
        distance = (
            features.square().sum(-1, keepdim=True)
            + rows.square().sum(-1)
            - 2 * features @ rows.transpose(0, 1)
        )
        return distance.argmin(dim=-1)

    @torch.no_grad()
    def shrink(self, seed: int) -> None:
        """Draw the N rows uniformly from +-1/N, as the public code begins."""
        rows = self.embedding.weight
        drawn = torch.rand(rows.shape, generator=torch.Generator().manual_seed(seed))
        rows.copy_((2 * drawn - 1) / len(rows))

    def look_up(self, codes: Tensor) -> Tensor:
        """Codes (...) to code vectors (..., C)."""
        return cast(Tensor, self.embedding(codes))


class VQAutoencoder(nn.Module):
    """Encoder, codebook and decoder of one part of the face."""

    def __init__(self, part: PartSpec, n_vertices: int) -> None:
        super().__init__()
        self.encoder = VQEncoder(part, n_vertices)
        self.decoder = VQDecoder(part, n_vertices)
        book, _ = part.prior
        self.quantize = Quantizer(book.n_codes, book.dim)

    def drop(self, share: float) -> None:
        """Drop this share, in training, behind the constants of encoder and decoder."""
        self.encoder.position_dropout.p = self.decoder.position_dropout.p = share

    def decode_features(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Features (B, T, H, C) to codes (B, T, H) and offsets (B, T, 3V)."""
        codes = self.quantize(features)
        return codes, self.decoder(self.quantize.look_up(codes))
