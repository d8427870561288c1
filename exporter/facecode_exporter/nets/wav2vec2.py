"""The speech encoder: wav2vec 2.0 with the frame grid between convolutions and transformer.

Receives normalised 16 kHz mono float32 (B, n_samples); gives memory rows (B, n_rows, width).
Knows nothing about files, nor about what reads the memory.
"""

from __future__ import annotations

from typing import Any, cast

import torch
from torch import Tensor
from torch.nn.utils.parametrize import remove_parametrizations
from transformers import Wav2Vec2Config, Wav2Vec2Model

from facecode_spec.schema import SpeechEncoderSpec


class Wav2Vec2(Wav2Vec2Model):  # type: ignore[misc]
    """`transformers`' Wav2Vec2Model, resampled to the frames of the motion (CodeTalker 3.2).

    The weight norm of the positional convolution is folded: `conv.weight` is the product.
    """

    def __init__(self, spec: SpeechEncoderSpec, fps: float) -> None:
        config = Wav2Vec2Config(**spec.architecture, attn_implementation="eager")
        super().__init__(config)
        self.spec, self.fps = spec, fps
        remove_parametrizations(self.encoder.pos_conv_embed.conv, "weight")
        # SpecAugment's mask vector: a parameter of every released file, unused in evaluation.
        self.masked_spec_embed = torch.nn.Parameter(torch.zeros(config.hidden_size))

    def forward(self, audio: Tensor, *_: Any, **__: Any) -> Tensor:  # noqa: ANN401
        """Audio (B, n_samples) to memory rows (B, n_frames * rows per frame, width)."""
        features = self.feature_extractor(audio).transpose(1, 2)
        gridded = (
            drop_odd_feature(features)
            if self.spec.frame_grid == "pairs"
            else interpolate_to_frames(features, self.spec.feature_rate, self.fps)
        )
        hidden, _unused = self.feature_projection(gridded)
        return self._transform(hidden)

    def _transform(self, hidden: Tensor) -> Tensor:
        # Wav2Vec2Encoder.forward without its mask building, which torch.export cannot follow.
        # No mask, no dropout, no layer drop: what it does in evaluation on a whole clip.
        encoder = self.encoder
        hidden = hidden + encoder.pos_conv_embed(hidden)
        if self.config.do_stable_layer_norm:
            for layer in encoder.layers:
                hidden = layer(hidden)
            return cast(Tensor, encoder.layer_norm(hidden))
        hidden = encoder.layer_norm(hidden)
        for layer in encoder.layers:
            hidden = layer(hidden)
        return hidden


def drop_odd_feature(features: Tensor) -> Tensor:
    """(B, n, C) to (B, 2 * (n // 2), C): frame i owns features 2i and 2i + 1 (BIWI)."""
    return features[:, : features.shape[1] // 2 * 2]


def interpolate_to_frames(features: Tensor, feature_rate: float, fps: float) -> Tensor:
    """(B, n, C) at `feature_rate` to (B, T, C) at `fps`, linear with aligned corners (VOCASET).

    The number of frames is the public code's `int(n / 50 * 30)` in float64, whose rounding loses
    a frame at n = 205, 410, 820, ...; `n * 3 // 5` would not. Positions are exact integer ratios.
    """
    n_features = features.shape[1]
    seconds = torch.scalar_tensor(n_features, dtype=torch.float64) / feature_rate
    n_frames = cast(int, (seconds * fps).to(torch.int64).item())
    torch._check(n_frames >= 1)
    last = torch.clamp(torch.scalar_tensor(n_frames, dtype=torch.int64) - 1, min=1)
    position = torch.arange(n_frames) * (n_features - 1)
    low = position // last
    high = torch.clamp(low + 1, max=n_features - 1)
    weight = ((position % last).double() / last.double()).to(features.dtype)[:, None]
    return features.index_select(1, low) * (1 - weight) + features.index_select(1, high) * weight


def n_features(spec: SpeechEncoderSpec, n_samples: int) -> int:
    """Features that the convolutions give for `n_samples` of audio."""
    config = Wav2Vec2Config(**spec.architecture)
    n = n_samples
    for kernel, stride in zip(config.conv_kernel, config.conv_stride, strict=True):
        n = (n - kernel) // stride + 1
    return max(n, 0)


def n_frames(spec: SpeechEncoderSpec, fps: float, n_samples: int) -> int:
    """Frames that `n_samples` of audio give; 0 when the audio is too short for one."""
    n = n_features(spec, n_samples)
    return n // 2 if spec.frame_grid == "pairs" else int(n / spec.feature_rate * fps)


def samples_for(spec: SpeechEncoderSpec, fps: float, frames: int) -> int:
    """The shortest audio, in samples, that gives at least `frames` frames."""
    low, high = 0, spec.sample_rate
    while n_frames(spec, fps, high) < frames:
        high *= 2
    while high - low > 1:
        middle = (low + high) // 2
        if n_frames(spec, fps, middle) >= frames:
            high = middle
        else:
            low = middle
    return high
