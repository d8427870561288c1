"""The convolutions of wav2vec 2.0 as they are exported: in segments, the first one folded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional as F
from transformers.models.wav2vec2.modeling_wav2vec2 import Wav2Vec2GroupNormConvLayer


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
        centred = samples - mean
        covariance = centred @ centred.transpose(1, 2) / centred.shape[2]
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
        # Segments of one length, the last one padded: torch.export reasons about one shape.
        n_each = (n + N_SEGMENTS - 1) // N_SEGMENTS
        n_read = (n_each - 1) * self.stride + self.reach
        x = F.pad(x, (0, N_SEGMENTS * n_each * self.stride))
        starts = [i * n_each * self.stride for i in range(N_SEGMENTS)]
        segments = [self._features(x.narrow(2, start, n_read), weight) for start in starts]
        return torch.cat(segments, dim=2)[:, :, :n]

    def _features(self, x: Tensor, weight: Tensor | None) -> Tensor:
        if weight is not None:
            x = self.activation(weight @ x)
        for layer in self.layers:
            x = layer(x)
        return x
