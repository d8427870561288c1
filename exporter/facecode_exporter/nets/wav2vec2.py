"""The speech encoder: wav2vec 2.0 with the frame grid between convolutions and transformer.

Receives normalised 16 kHz mono float32 (B, n_samples); gives memory rows (B, n_rows, width).
Knows nothing about files, nor about what reads the memory.
"""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any, cast

import torch
from torch import Tensor, nn
from torch.nn.utils.parametrize import remove_parametrizations
from transformers import Wav2Vec2Config, Wav2Vec2Model

from facecode_exporter.nets.frame_grid import to_frames
from facecode_exporter.nets.segmented_convolutions import SegmentedConvolutions
from facecode_spec.schema import SpeechEncoderSpec


class Wav2Vec2(Wav2Vec2Model):  # type: ignore[misc]
    """`transformers`' Wav2Vec2Model, resampled to the frames of the motion (CodeTalker 3.2).

    The weight norm of the positional convolution is folded: `conv.weight` is the product.
    """

    hugging_face = Wav2Vec2Config
    frozen = ("feature_extractor.",)
    kept_float = ()

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
        hidden, _unused = self.feature_projection(to_frames(features, self.spec, self.fps))
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

    @staticmethod
    def n_features(spec: SpeechEncoderSpec, n_samples: int) -> int:
        """Features that the convolutions give for `n_samples` of audio."""
        config = Wav2Vec2Config(**spec.architecture)
        n = n_samples
        for kernel, stride in zip(config.conv_kernel, config.conv_stride, strict=True):
            n = (n - kernel) // stride + 1
        return max(n, 0)

    @staticmethod
    def width_of(spec: SpeechEncoderSpec) -> int:
        """Width of a memory row."""
        return cast(int, Wav2Vec2Config(**spec.architecture).hidden_size)

    @staticmethod
    def pretrained(folder: Path) -> dict[str, Tensor]:
        """The weights of a Hugging Face folder, under the names of this module."""
        source = Wav2Vec2Model.from_pretrained(folder, local_files_only=True)
        remove_parametrizations(source.encoder.pos_conv_embed.conv, "weight")
        return dict(source.state_dict())

    @staticmethod
    def for_export(encoder: nn.Module) -> nn.Module:
        """`encoder`, sharing its weights, with convolutions that run in segments."""
        shared = {id(t): t for t in (*encoder.parameters(), *encoder.buffers())}
        own = copy.deepcopy(cast(Wav2Vec2, encoder), shared)
        own.feature_extractor = SegmentedConvolutions(own.feature_extractor.conv_layers)
        return own
