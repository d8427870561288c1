"""The speech encoder of Whisper (Radford et al. 2022), log-mel front end included.

Receives 16 kHz mono float32 (B, n_samples), not normalised; gives memory rows (B, n_rows, width).
Unlike the published use there is no padding to 30 s: positions are cut, or go on, with the clip.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, cast

import torch
from torch import Tensor, nn
from torch.nn import functional as F
from transformers import WhisperConfig, WhisperModel
from transformers.audio_utils import mel_filter_bank
from transformers.models.whisper.modeling_whisper import WhisperEncoderLayer

from facecode_exporter.nets.frame_grid import to_frames
from facecode_spec.schema import SpeechEncoderSpec

N_FFT, HOP = 400, 160


class LogMel(nn.Module):
    """Log-mel spectrogram at 100 Hz, the Fourier transform written as a convolution."""

    def __init__(self, n_mels: int) -> None:
        super().__init__()
        n_bins = N_FFT // 2 + 1
        angle = (
            2 * math.pi * torch.outer(torch.arange(n_bins), torch.arange(N_FFT)).double() / N_FFT
        )
        window = torch.hann_window(N_FFT, dtype=torch.float64)
        waves = torch.cat([angle.cos() * window, angle.sin() * window]).float()
        filters = mel_filter_bank(
            n_bins, n_mels, 0.0, 8000.0, 16_000, norm="slaney", mel_scale="slaney"
        )
        self.register_buffer("waves", waves[:, None], persistent=False)
        self.register_buffer("filters", torch.from_numpy(filters).float(), persistent=False)
        self.waves: Tensor
        self.filters: Tensor

    def forward(self, audio: Tensor) -> Tensor:
        """Audio (B, n_samples) to (B, n_mels, n_samples // 160), scaled as Whisper's."""
        padded = F.pad(audio[:, None], (N_FFT // 2, N_FFT // 2), mode="reflect")
        spectrum = F.conv1d(padded, self.waves, stride=HOP)[:, :, :-1]
        real, imaginary = spectrum.chunk(2, dim=1)
        power = (real.square() + imaginary.square()).transpose(1, 2)
        mel = torch.log10((power @ self.filters).clamp_min(1e-10)).transpose(1, 2)
        loudest = mel.amax(dim=(1, 2), keepdim=True)
        return (torch.maximum(mel, loudest - 8.0) + 4.0) / 4.0


class Whisper(nn.Module):
    """Whisper's encoder on clips of any length, resampled to the frames of the motion."""

    hugging_face = WhisperConfig
    frozen = ("conv1.", "conv2.")
    kept_float = ("log_mel.filters",)  # power spectra span ten decades

    def __init__(self, spec: SpeechEncoderSpec, fps: float) -> None:
        super().__init__()
        config = _config(spec)
        self.spec, self.fps = spec, fps
        self.log_mel = LogMel(config.num_mel_bins)
        width = config.d_model
        self.conv1 = nn.Conv1d(config.num_mel_bins, width, 3, padding=1)
        self.conv2 = nn.Conv1d(width, width, 3, stride=2, padding=1)
        self.layers = nn.ModuleList(
            [WhisperEncoderLayer(config) for _ in range(config.encoder_layers)]
        )
        self.layer_norm = nn.LayerNorm(width)
        rates = torch.exp(
            -math.log(10_000.0) / (width // 2 - 1) * torch.arange(width // 2, dtype=torch.float32)
        )
        self.register_buffer("rates", rates, persistent=False)
        self.rates: Tensor

    def forward(self, audio: Tensor) -> Tensor:
        """Audio (B, n_samples) to memory rows (B, n_frames * rows per frame, width)."""
        x = F.gelu(self.conv1(self.log_mel(audio)))
        x = F.gelu(self.conv2(x)).transpose(1, 2)
        x = x + self.positions(x.shape[1])
        for layer in self.layers:
            x = layer(x, attention_mask=None)
        return to_frames(self.layer_norm(x), self.spec, self.fps)

    def positions(self, n: int) -> Tensor:
        """Whisper's sine | cosine position code of n features: (n, width)."""
        angle = torch.arange(n, dtype=torch.float32)[:, None] * self.rates
        return torch.cat([angle.sin(), angle.cos()], dim=-1)

    @staticmethod
    def n_features(spec: SpeechEncoderSpec, n_samples: int) -> int:
        """Features for `n_samples`: one for every two hops of the spectrogram."""
        del spec
        return 0 if n_samples <= N_FFT // 2 else (n_samples // HOP + 1) // 2

    @staticmethod
    def width_of(spec: SpeechEncoderSpec) -> int:
        """Width of a memory row."""
        return cast(int, _config(spec).d_model)

    @staticmethod
    def pretrained(folder: Path) -> dict[str, Tensor]:
        """The weights of a Hugging Face folder, under the names of this module."""
        state = WhisperModel.from_pretrained(folder, local_files_only=True).encoder.state_dict()
        return {k: v for k, v in state.items() if not k.startswith("embed_positions.")}

    @staticmethod
    def for_export(encoder: nn.Module) -> nn.Module:
        """`encoder` as it is."""
        return encoder


def _config(spec: SpeechEncoderSpec) -> Any:  # noqa: ANN401
    return WhisperConfig(**spec.architecture, attn_implementation="eager")
