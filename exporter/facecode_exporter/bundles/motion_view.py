"""The motion decoder as a graph that carries state: code features to hidden frames.

One graph serves three callers. The whole clip, or the prefix of `exact`, comes without a past. A
`window` decodes a few frames over what the frames before left behind: the sums of the instance
norm, keys and values. Convolution outputs that no new frame can change come ready-made.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import torch
from torch import Tensor, nn

from facecode_exporter.bundles.views import fuse, linear
from facecode_exporter.nets.part import PartNet
from facecode_exporter.nets.pre_norm import Attention, PreNorm, Residual
from facecode_exporter.nets.vq_autoencoder import ClipNorm, VQDecoder


class ResumedNorm(nn.Module):
    """Instance norm over the frames at hand and `count` earlier ones, of which sums are known.

    With `count` 0 it is `ClipNorm`: the update is that of Chan et al. 1979, mean first.
    """

    def __init__(self, norm: ClipNorm) -> None:
        super().__init__()
        self.norm = norm

    def forward(
        self, revisited: Tensor, x: Tensor, count: Tensor, mean: Tensor, squares: Tensor
    ) -> Tensor:
        """Frames (B, s, E) of the past and new ones (B, n, E), normed: (B, s + n, E).

        `count` (), `mean` and `squares` (B, E), the sum of squared deviations, are of the past.
        """
        total = count + x.shape[1]
        mean = mean[:, None]
        now = mean + (x - mean).sum(dim=1, keepdim=True) / total
        spread = squares[:, None] + count * (mean - now).square()
        variance = (spread + (x - now).square().sum(dim=1, keepdim=True)) / total
        centred = torch.cat([revisited, x], dim=1) - now
        normed = centred * torch.rsqrt(variance + self.norm.eps)
        if self.norm.weight is None or self.norm.bias is None:
            return normed
        return normed * self.norm.weight + self.norm.bias


@dataclass(frozen=True)
class Past:
    """What one layer keeps of earlier frames."""

    keys: Tensor
    values: Tensor
    """(B, heads, p, head width)"""
    n: int
    """p"""
    log_weights: Tensor
    """(p + n,): how many frames a row stands for, of past and own rows"""


class ResumedAttention(nn.Module):
    """The attention of frames over themselves and over past rows, each with a weight.

    Past rows lie as the products read them, (B, heads, p, head width), and are not copied.
    """

    def __init__(self, attention: Attention) -> None:
        super().__init__()
        self.n_heads, self.scale = attention.n_heads, attention.dim**-0.5
        self.to_out = attention.to_out

    def split(self, x: Tensor, n: int) -> tuple[Tensor, ...]:
        """`n` tensors side by side, (B, m, n E), to each of them (1, B, heads, m, head width)."""
        heads: Tensor = x.unflatten(-1, (n, self.n_heads, -1))
        return cast("tuple[Tensor, ...]", heads.permute(2, 0, 3, 1, 4).split(1))

    def forward(self, query: Tensor, key: Tensor, value: Tensor, past: Past) -> Tensor:
        """Queries (1, B, heads, m, w), own keys and values (1, B, heads, n, w) to (B, m, E)."""
        query = query * self.scale
        over_past = query @ past.keys.transpose(-1, -2)
        over_own = query @ key.transpose(-1, -2)
        scores = torch.cat([over_past, over_own], dim=-1) + past.log_weights
        weights = torch.softmax(scores, dim=-1)
        of_past, own = weights.split([past.n, key.shape[3]], dim=-1)
        mixed = of_past @ past.values + own @ value
        _, n_rows, n_heads, n_frames, width = query.shape
        joined = mixed.transpose(2, 3).reshape(n_rows, n_frames, n_heads * width)
        return cast(Tensor, self.to_out(joined))


class ResumedLayer(nn.Module):
    """A pre-norm transformer layer whose frames also attend to past keys and values."""

    def __init__(self, attention_block: Residual, mlp_block: Residual) -> None:
        super().__init__()
        pre_norm = cast(PreNorm, attention_block.fn)
        attention = cast(Attention, pre_norm.fn)
        self.norm, self.to_qkv = pre_norm.norm, attention.to_qkv
        self.attend = ResumedAttention(attention)
        self.mlp = mlp_block

    def forward(self, x: Tensor, past: Past) -> tuple[Tensor, Tensor, Tensor]:
        """x (B, n, E) to x, and keys and values (1, B, heads, n, w) of its frames."""
        query, key, value = self.attend.split(self.to_qkv(self.norm(x)), 3)
        x = x + self.attend(query, key, value, past)
        return cast(Tensor, self.mlp(x)), key, value


class LastLayer(nn.Module):
    """The last transformer layer, with queries and MLP for the frames that are asked for."""

    def __init__(self, attention_block: Residual, mlp_block: Residual) -> None:
        super().__init__()
        pre_norm = cast(PreNorm, attention_block.fn)
        attention = cast(Attention, pre_norm.fn)
        self.norm, self.mlp = pre_norm.norm, mlp_block
        self.attend = ResumedAttention(attention)
        dim, weight = attention.dim, attention.to_qkv.weight
        self.to_query = nn.Linear(dim, dim, bias=False)
        self.to_key_value = nn.Linear(dim, 2 * dim, bias=False)
        with torch.no_grad():
            self.to_query.weight.copy_(weight[:dim])
            self.to_key_value.weight.copy_(weight[dim:])

    def forward(self, x: Tensor, past: Past, frames: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """As `ResumedLayer`, for `frames` (m,): hidden (B, m, E) in place of x."""
        normed = self.norm(x)
        key, value = self.attend.split(self.to_key_value(normed), 2)
        (query,) = self.attend.split(self.to_query(normed.index_select(1, frames)), 1)
        shown = x.index_select(1, frames) + self.attend(query, key, value, past)
        return cast(Tensor, self.mlp(shown)), key, value


class MotionDecoderView(nn.Module):
    """Quantise and decode; see the GraphSpec for what each input and output is."""

    def __init__(self, net: PartNet) -> None:
        super().__init__()
        decoder: VQDecoder = net.autoencoder.decoder
        self.quantize = net.autoencoder.quantize
        # Distances in float64, as the runtime's: a look-up of code vectors gives their codes.
        self.register_buffer("codebook", self.quantize.embedding.weight.double())
        self.codebook: Tensor
        self.project = getattr(decoder, "decoder_linear_embedding_pre", None)
        expander = decoder.get_submodule("expander.0")
        self.taps = convolution_as_linear(cast(nn.Conv1d, expander.get_submodule("0")))
        self.bend = cast(nn.LeakyReLU, expander.get_submodule("1"))
        self.norm = ResumedNorm(cast(ClipNorm, expander.get_submodule("2")))
        self.embed = decoder.get_submodule("decoder_linear_embedding")
        self.register_buffer("constant", decoder.constant)
        self.constant: Tensor
        blocks = [cast(Residual, block) for block in decoder.transformer.net]
        pairs = zip(blocks[:-2:2], blocks[1:-2:2], strict=True)
        self.layers = nn.ModuleList([ResumedLayer(*pair) for pair in pairs])
        self.last = LastLayer(blocks[-2], blocks[-1])
        self.feed_back = fuse(net.vertice_map, decoder.vertice_map_reverse)

    def forward(
        self,
        features: Tensor,
        context: Tensor,
        known: Tensor,
        revisited: Tensor,
        frames: Tensor,
        count: Tensor,
        mean: Tensor,
        squares: Tensor,
        past_log_weights: Tensor,
        revisited_log_weights: Tensor,
        *past: Tensor,
    ) -> tuple[Tensor, ...]:
        """See `facecode_spec.graphs.motion_decoder` for names and shapes."""
        torch._check(features.shape[1] >= 1)
        half_norms = self.codebook.square().sum(dim=-1) / 2
        codes = (half_norms - features.double() @ self.codebook.transpose(0, 1)).argmin(dim=-1)
        activations = self.convolve(self.quantize.look_up(codes), context)
        latest = torch.cat([known, activations], dim=1)
        normed = self.norm(revisited, latest, count, mean, squares)
        x = cast(Tensor, self.embed(normed)) + self.constant
        own = torch.zeros(latest.shape[1])
        log_weights = torch.cat([past_log_weights, revisited_log_weights, own])
        n_layers, n_past = len(self.layers) + 1, past_log_weights.shape[0]
        kept = []
        for i in range(n_layers):
            before = Past(past[i], past[n_layers + i], n_past, log_weights)
            if i + 1 < n_layers:
                x, key, value = self.layers[i](x, before)
            else:
                x, key, value = self.last(x, before, frames)
            kept.append((key, value))
        # Of the frames that are no longer decoded next time: those revisited and the oldest.
        n_kept = revisited.shape[1] + 1
        keys, values = (torch.cat(rows)[:, :, :, :n_kept] for rows in zip(*kept, strict=True))
        return codes, x, self.feed_back(x[:, -1]), activations, keys, values

    def convolve(self, vectors: Tensor, context: Tensor) -> Tensor:
        """Code vectors (B, n, H, C) after `context` to convolution outputs (B, n, E)."""
        x = torch.cat([context, vectors], dim=1).flatten(2)
        if self.project is not None:
            x = self.project(x)
        x = torch.cat([x[:, :1], x[:, :1], x, x[:, -1:], x[:, -1:]], dim=1)
        n, start = vectors.shape[1], context.shape[1]
        x = torch.cat([x.narrow(1, start + i, n) for i in range(5)], dim=-1)
        return cast(Tensor, self.bend(self.taps(x)))


def convolution_as_linear(convolution: nn.Conv1d) -> nn.Linear:
    """The layer that gives one output frame from the five input frames side by side.

    onnxruntime packs the weights of a product once; those of a convolution it reads slower.
    """
    assert convolution.bias is not None
    return linear(convolution.weight.permute(0, 2, 1).flatten(1), convolution.bias)
