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

from facecode_exporter.nets.frame_grid import to_frames, to_motion
from facecode_exporter.nets.segmented_convolutions import SegmentedConvolutions
from facecode_spec.schema import SpeechEncoderSpec

MASK_LENGTH, FEWEST_MASKS = 10, 2
"""Of SpecAugment, in frames and in spans a clip: the published values."""


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
        self.mask_share = self.layer_drop = 0.0
        self.input_dropout = nn.Dropout(0.0)

    def disturb(self, mask_share: float, layer_drop: float, dropout: float) -> None:
        """What training does to it beside the dropout within its layers.

        Args:
            mask_share: of the frames, hidden in spans of MASK_LENGTH (SpecAugment).
            layer_drop: chance of each layer to be left out.
            dropout: share dropped in front of the layers.
        """
        self.mask_share, self.layer_drop = mask_share, layer_drop
        self.input_dropout.p = dropout

    def forward(self, audio: Tensor, *_: Any, **__: Any) -> Tensor:  # noqa: ANN401
        """Audio (B, n_samples) to memory rows (B, n_frames * rows per frame, width)."""
        return self._heard(to_frames(self._convolved(audio), self.spec, self.fps))

    def aligned(self, audio: Tensor, n_frames: int) -> Tensor:
        """As `forward`, on the frames of motion of `n_frames`; see `to_motion`."""
        return self._heard(to_motion(self._convolved(audio), self.spec, n_frames))

    def _convolved(self, audio: Tensor) -> Tensor:
        return cast(Tensor, self.feature_extractor(audio).transpose(1, 2))

    def _heard(self, features: Tensor) -> Tensor:
        hidden, _unused = self.feature_projection(features)
        if self.training and self.mask_share:
            mask = span_mask(len(hidden), hidden.shape[1], self.mask_share)
            hidden = torch.where(mask[..., None], self.masked_spec_embed, hidden)
        return self._transform(hidden)

    def _transform(self, hidden: Tensor) -> Tensor:
        # Wav2Vec2Encoder.forward without its mask building, which torch.export cannot follow.
        encoder = self.encoder
        hidden = hidden + encoder.pos_conv_embed(hidden)
        is_last = self.config.do_stable_layer_norm
        hidden = self.input_dropout(hidden if is_last else encoder.layer_norm(hidden))
        for layer in encoder.layers:
            if not self._is_dropped():
                hidden = layer(hidden)
        return cast(Tensor, encoder.layer_norm(hidden)) if is_last else hidden

    def _is_dropped(self) -> bool:
        return self.training and self.layer_drop > 0 and bool(torch.rand(()) < self.layer_drop)

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


def span_mask(n_clips: int, n_frames: int, share: float) -> Tensor:
    """(n_clips, n_frames) bool: spans that overlap, begun at random, FEWEST_MASKS at least.

    They cover `share` of the frames if none overlaps; a clip shorter than a span has none.
    """
    mask = torch.zeros(n_clips, n_frames, dtype=torch.bool)
    n_starts = n_frames - MASK_LENGTH + 1
    for clip in mask if n_starts > 0 else ():
        wanted = int(share * n_frames / MASK_LENGTH + float(torch.rand(())))
        n_spans = min(max(wanted, FEWEST_MASKS), n_frames // MASK_LENGTH)
        starts = torch.randperm(n_starts)[:n_spans]
        clip[(starts[:, None] + torch.arange(MASK_LENGTH)).flatten()] = True
    return mask
