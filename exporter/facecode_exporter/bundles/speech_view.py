"""The speech encoder as a graph: a waveform to what the cross-attention of every part reads."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from itertools import pairwise
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional as F
from transformers.models.wav2vec2.modeling_wav2vec2 import Wav2Vec2GroupNormConvLayer

from facecode_exporter.bundles.views import fuse, key_and_value, rows, stack
from facecode_exporter.nets.cdface import Trained
from facecode_exporter.nets.part import PartNet
from facecode_exporter.nets.wav2vec2 import Wav2Vec2


class SpeechEncoderView(nn.Module):
    """audio -> what the cross-attention of every part and layer reads, frame by frame."""

    def __init__(self, net: Trained) -> None:
        super().__init__()
        self.audio_encoder = with_segments(net.audio_encoder)
        self.memories = nn.ModuleList([CrossMemory(part) for part in net.part_nets])

    def forward(self, audio: Tensor) -> tuple[Tensor, ...]:
        """(B, n_samples) to each part's cross_output, or its cross_keys and cross_values."""
        speech = self.audio_encoder(audio)
        return tuple(rows for memory in self.memories for rows in memory(speech))


class CrossMemory(nn.Module):
    """Speech features -> what the cross-attention of one part reads."""

    def __init__(self, net: PartNet) -> None:
        super().__init__()
        self.to_memory = net.audio_feature_map
        self.n_rows = net.system.speech_encoder.memory_rows_per_frame
        self.n_layers = net.part.cross_modal_decoder.n_layers
        attentions = [layer.multihead_attn for layer in net.transformer_decoder.layers]
        if self.n_rows == 1:
            # One visible key: softmax is 1 and the attention is out_proj(v_proj(memory)).
            self.maps = nn.ModuleList([stack([fuse(a.out_proj, rows(a, 2)) for a in attentions])])
        else:
            kinds = zip(*(key_and_value(a) for a in attentions), strict=True)
            self.maps = nn.ModuleList([stack(list(kind)) for kind in kinds])

    def forward(self, speech: Tensor) -> tuple[Tensor, ...]:
        """(B, T * rows, width) to cross_output, or to cross_keys and cross_values."""
        memory = self.to_memory(speech)
        outputs = [m(memory).unflatten(-1, (self.n_layers, -1)) for m in self.maps]
        if self.n_rows == 1:
            return tuple(outputs)
        return tuple(o.unflatten(1, (-1, self.n_rows)).transpose(2, 3) for o in outputs)


class NormedTaps(nn.Module):
    """The first convolution of wav2vec 2.0 base and its norm over the clip, as one product.

    The norm is linear once mean and variance are known, and those of a channel follow from the mean
    and covariance of the samples under its kernel: what is left goes frame by frame.
    """

    def __init__(self, layer: Wav2Vec2GroupNormConvLayer) -> None:
        super().__init__()
        convolution, norm = layer.conv, layer.layer_norm
        assert convolution.in_channels == 1, convolution
        self.stride, self.eps = convolution.stride, norm.eps
        n_taps = convolution.kernel_size[0]
        self.register_buffer("weight", convolution.weight[:, 0].double())
        self.register_buffer("gain", norm.weight.double())
        self.register_buffer("offset", norm.bias.double())
        # Every sample under the kernel as a channel, and a channel of ones.
        self.register_buffer("taps", torch.eye(n_taps + 1, n_taps)[:, None])
        self.register_buffer("one", torch.eye(n_taps + 1)[-1])
        self.weight: Tensor
        self.gain: Tensor
        self.offset: Tensor
        self.taps: Tensor
        self.one: Tensor

    def forward(self, audio: Tensor) -> tuple[Tensor, Tensor]:
        """Audio (B, 1, n_samples) to taps (B, k + 1, n) and the weights (B, C, k + 1) of channels.

        A bias of the convolution would vanish in the norm.
        """
        taps = F.conv1d(audio, self.taps, self.one, self.stride)
        samples = taps[:, :-1].double()
        mean = samples.mean(dim=2, keepdim=True)
        apart = samples - mean
        covariance = apart @ apart.transpose(1, 2) / apart.shape[2]
        variance = ((self.weight @ covariance) * self.weight).sum(dim=2)
        scale = self.gain * torch.rsqrt(variance + self.eps)
        weight = self.weight * scale[:, :, None]
        offset = self.offset[:, None] - weight @ mean
        return taps, torch.cat([weight, offset], dim=2).to(audio.dtype)


N_SEGMENTS = 4


class SegmentedConvolutions(nn.Module):
    """The convolutions of wav2vec 2.0, a quarter of the clip after the other.

    At 30 s the first layer's output takes 200 MB, and what follows it as much again. But for that
    norm, each feature depends on 400 samples alone, so that segments give the same features.
    """

    def __init__(self, layers: Sequence[nn.Module]) -> None:
        super().__init__()
        first = layers[0]
        self.taps = None
        if isinstance(first, Wav2Vec2GroupNormConvLayer):
            self.taps, self.activation = NormedTaps(first), first.activation
            layers = layers[1:]
        self.layers = nn.ModuleList(layers)
        self.stride = self.reach = 1
        for layer in layers:
            convolution = cast(nn.Conv1d, layer.conv)
            self.reach += (convolution.kernel_size[0] - 1) * self.stride
            self.stride *= convolution.stride[0]

    def forward(self, audio: Tensor) -> Tensor:
        """Audio (B, n_samples) to features (B, C, n)."""
        x, weight = audio[:, None], None
        if self.taps is not None:
            x, weight = self.taps(x)
        n = (x.shape[2] - self.reach) // self.stride + 1
        edges = [n * i // N_SEGMENTS for i in range(N_SEGMENTS + 1)]
        segments = []
        for start, stop in pairwise(edges):
            # A clip of few features has segments without any: one is made and dropped.
            n_made = torch.sym_max(stop - start, 1)
            part = x.narrow(2, start * self.stride, (n_made - 1) * self.stride + self.reach)
            segments.append(self._features(part, weight)[:, :, : stop - start])
        return torch.cat(segments, dim=2)

    def _features(self, x: Tensor, weight: Tensor | None) -> Tensor:
        if weight is not None:
            x = self.activation(weight @ x)
        for layer in self.layers:
            x = layer(x)
        return x


def with_segments(encoder: nn.Module) -> nn.Module:
    """`encoder`, with the same weights, whose convolutions run in segments if it is wav2vec 2.0."""
    if not isinstance(encoder, Wav2Vec2):
        return encoder
    shared = {id(t): t for t in (*encoder.parameters(), *encoder.buffers())}
    encoder = copy.deepcopy(encoder, shared)
    encoder.feature_extractor = SegmentedConvolutions(encoder.feature_extractor.conv_layers)
    return encoder
