"""The graphs as modules: each forward has exactly the signature of its GraphSpec.

A view rearranges trained weights and adds none; the algebra that it uses is exact, and products of
weights are formed in float64. Nothing 3V-wide is left inside the loop: `feedback` is the
output layer and the embedding of its result in one E x D product.
"""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn

from facecode_exporter.nets.part import PartNet
from facecode_exporter.nets.speech_decoder import SpeechDecoder, alibi_slopes


def fuse(outer: nn.Linear, inner: nn.Linear) -> nn.Linear:
    """The linear layer that computes `outer(inner(x))`."""
    weight = outer.weight.double() @ inner.weight.double()
    bias = torch.zeros(outer.out_features, dtype=torch.float64)
    if inner.bias is not None:
        bias = bias + outer.weight.double() @ inner.bias.double()
    if outer.bias is not None:
        bias = bias + outer.bias.double()
    return linear(weight, bias)


def linear(weight: Tensor, bias: Tensor) -> nn.Linear:
    """A float32 layer with the given (out, in) weight and (out,) bias."""
    layer = nn.Linear(weight.shape[1], weight.shape[0])
    with torch.no_grad():
        layer.weight.copy_(weight)
        layer.bias.copy_(bias)
    return layer


def rows(attention: nn.MultiheadAttention, index: int) -> nn.Linear:
    """Query (0), key (1) or value (2) projection of torch's packed attention."""
    packed = slice(index * attention.embed_dim, (index + 1) * attention.embed_dim)
    return linear(attention.in_proj_weight[packed], attention.in_proj_bias[packed])


def key_and_value(attention: nn.MultiheadAttention) -> list[nn.Linear]:
    """Key and value projection."""
    return [rows(attention, index) for index in (1, 2)]


def stack(layers: list[nn.Linear]) -> nn.Linear:
    """Layers of one width side by side: (in) to (n_layers * out)."""
    return linear(
        torch.cat([layer.weight for layer in layers]), torch.cat([layer.bias for layer in layers])
    )


class SelfAttentionStep(nn.Module):
    """Self-attention of one new frame over the past rows and itself.

    Past rows lie head by head, as the products read them; a product with one row is one for which
    onnxruntime neither packs nor copies the other side.
    """

    def __init__(self, attention: nn.MultiheadAttention) -> None:
        super().__init__()
        self.n_heads, self.dim = attention.num_heads, attention.embed_dim
        self.to_qkv = stack([rows(attention, 0), *key_and_value(attention)])
        self.to_out = attention.out_proj
        # Of the query alone, and not one number: onnxruntime would join that with the product.
        scales = torch.ones(3 * self.dim)
        scales[: self.dim] = (self.dim // self.n_heads) ** -0.5
        self.register_buffer("scales", scales)
        self.scales: Tensor

    def forward(
        self, x: Tensor, keys: Tensor, values: Tensor, bias: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Attended (B, 1, D), and query, key and value side by side (B, 1, 3 D).

        Args:
            x: (B, 1, D).
            keys: of the past, (B, heads, n, head width).
            values: of the past, (B, heads, n, head width).
            bias: (heads, 1, n).
        """
        qkv = self.to_qkv(x) * self.scales
        width = self.dim // self.n_heads
        query, key, value = qkv.reshape(-1, 3 * self.n_heads, 1, width).chunk(3, dim=1)
        over_past = query @ keys.transpose(2, 3) + bias
        over_own = (query * key).sum(dim=3, keepdim=True)
        scores = torch.cat([over_past, over_own], dim=3)
        of_past, own = torch.softmax(scores, dim=3).split([keys.shape[2], 1], dim=3)
        mixed = of_past @ values + own * value
        return self.to_out(mixed.reshape(-1, 1, self.dim)), qkv


class CrossAttentionStep(nn.Module):
    """Cross-attention of one frame over its few memory rows, keys and values precomputed."""

    def __init__(self, attention: nn.MultiheadAttention) -> None:
        super().__init__()
        self.n_heads = attention.num_heads
        self.to_query = rows(attention, 0)
        self.scale = (attention.embed_dim // self.n_heads) ** -0.5
        self.to_out = attention.out_proj

    def forward(self, x: Tensor, keys: Tensor, values: Tensor) -> Tensor:
        """x (B, 1, D), keys and values (B, 1, rows, heads, head width) to (B, 1, D)."""
        query = (self.to_query(x) * self.scale).unflatten(-1, (1, self.n_heads, -1))
        weights = torch.softmax((query * keys).sum(dim=-1, keepdim=True), dim=2)
        return cast(Tensor, self.to_out((weights * values).sum(dim=2).flatten(2)))


class StepView(nn.Module):
    """One frame of the decoder; the state is passed in and the new rows come out."""

    def __init__(self, net: SpeechDecoder) -> None:
        super().__init__()
        spec = net.part.cross_modal_decoder
        self.n_layers, self.n_heads, self.period = spec.n_layers, spec.n_heads, spec.period
        self.layers = net.transformer_decoder.layers
        self.self_attention = nn.ModuleList(
            [SelfAttentionStep(layer.self_attn) for layer in self.layers]
        )
        self.one_row = net.system.speech_encoder.memory_rows_per_frame == 1
        if not self.one_row:
            self.cross_attention = nn.ModuleList(
                [CrossAttentionStep(layer.multihead_attn) for layer in self.layers]
            )
        self.register_buffer("style_rows", net.style_rows.detach())
        self.style_rows: Tensor
        self.register_buffer("position_code", net.position_code)
        self.position_code: Tensor
        self.register_buffer("slopes", torch.tensor(alibi_slopes(spec.n_heads)))
        self.slopes: Tensor
        self.condition_map = nn.ModuleDict()
        self.n_samples = net.part.n_samples

    def predict(self, x: Tensor, sample: Tensor | None) -> tuple[Tensor, ...]:
        """What is said of x (B, 1, D), the frame behind the last layer; see the GraphSpec."""
        raise NotImplementedError

    def forward(
        self, motion: Tensor, style: Tensor, step: Tensor, *state: Tensor
    ) -> tuple[Tensor, ...]:
        """motion (B, D), style (B, S), step (), then the sample of each row if there are several.

        Then the code vectors of each condition, cross memory, past keys and past values.
        """
        more, past = state[: -2 * self.n_layers], state[-2 * self.n_layers :]
        sample, more = (more[0], more[1:]) if self.n_samples > 1 else (None, more)
        n_conditions = len(self.condition_map)
        conditions, cross = more[:n_conditions], self._cross_layers(more[n_conditions:])
        position = self.position_code.index_select(0, (step % self.period)[None])
        token = motion + style @ self.style_rows + position
        for embed, vectors in zip(self.condition_map.values(), conditions, strict=True):
            token = token + embed(vectors.flatten(1))
        x = token[:, None]
        bias = self._bias(step, past[0].shape[2])
        rows_of_layers = []
        for i, layer in enumerate(self.layers):
            attended, qkv = self.self_attention[i](x, past[i], past[self.n_layers + i], bias)
            rows_of_layers.append(qkv)
            x = layer.norm1(x + attended)
            x = layer.norm2(x + self._attend_speech(i, x, cross))
            x = layer.norm3(x + layer.linear2(torch.relu(layer.linear1(x))))
        new = torch.cat(rows_of_layers).reshape(self.n_layers, -1, rows_of_layers[0].shape[-1])
        _, keys, values = new.chunk(3, dim=-1)
        return *self.predict(x, sample), keys, values

    def _bias(self, step: Tensor, n_slots: int) -> Tensor:
        """-floor(distance / period) * slope, -inf for empty slots: (heads, 1, n_slots)."""
        slot = torch.arange(n_slots)
        ring = torch.scalar_tensor(n_slots, dtype=torch.int64).clamp(min=1)
        distance = (step - 1 - slot) % ring + 1
        bias = torch.floor(distance / self.period) * -self.slopes[:, None, None]
        return torch.where(slot < step, bias, -torch.inf)

    def _cross_layers(self, cross: tuple[Tensor, ...]) -> list[tuple[Tensor, ...]]:
        """What each layer reads: (B, 1, D), or keys and values (B, 1, rows, heads, width)."""
        if not self.one_row:
            cross = tuple(c.unflatten(-1, (self.n_heads, -1)) for c in cross)
        return list(zip(*(c.split(1, dim=1) for c in cross), strict=True))

    def _attend_speech(self, i: int, x: Tensor, cross: list[tuple[Tensor, ...]]) -> Tensor:
        """Output (B, 1, D) of the cross-attention of layer `i`."""
        if self.one_row:
            return cross[i][0]
        return cast(Tensor, self.cross_attention[i](x, *cross[i]))


class DecoderStepView(StepView):
    """The step of a part of kind `codes`."""

    def __init__(self, net: PartNet) -> None:
        super().__init__(net)
        self.condition_map = net.condition_map
        self.feat_map = net.feat_map
        book, _ = net.part.prior
        self.head_shape = (net.part.n_samples, book.codes_per_frame, book.dim)

    def predict(self, x: Tensor, sample: Tensor | None) -> tuple[Tensor, ...]:
        """Features (B, H, C) of head `sample[b]`; all heads share one read of the weights."""
        every: Tensor = self.feat_map(x[:, 0]).unflatten(-1, self.head_shape)
        if sample is None:
            return (every[:, 0],)
        index = sample[:, None, None, None].expand(-1, 1, *self.head_shape[1:])
        return (every.gather(1, index)[:, 0],)


class VertexHeadView(nn.Module):
    """The output layer: hidden frames -> offsets.

    Vertices that no weight moves, such as the back of a head, are left out of the product and
    filled with zeros.
    """

    def __init__(self, net: SpeechDecoder) -> None:
        super().__init__()
        layer = net.output_layer
        bias = torch.zeros(layer.out_features) if layer.bias is None else layer.bias
        moves = (layer.weight != 0).any(dim=1) | (bias != 0)
        moves = moves.unflatten(0, (-1, 3)).any(dim=1)
        self.all_move = bool(moves.all())
        if self.all_move:
            self.output = layer
            return
        shown = moves.repeat_interleave(3)
        self.output = linear(layer.weight[shown], bias[shown])
        # Row of each vertex among those that move; one row of zeros stands behind them.
        source = torch.where(moves, moves.cumsum(0) - 1, moves.sum())
        self.register_buffer("source", source)
        self.source: Tensor

    def forward(self, hidden: Tensor) -> Tensor:
        """hidden (B, n, E) to offsets (B, n, V, 3)."""
        offsets: Tensor = self.output(hidden).unflatten(-1, (-1, 3))
        if self.all_move:
            return offsets
        still = torch.zeros_like(offsets[:, :, :1])
        return torch.cat([offsets, still], dim=2).index_select(2, self.source)
