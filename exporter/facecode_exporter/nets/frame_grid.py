"""From the features of a speech encoder, about 50 a second, to the frames of the motion."""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor
from torch.nn import functional

from facecode_spec.schema import SpeechEncoderSpec


def to_frames(features: Tensor, spec: SpeechEncoderSpec, fps: float) -> Tensor:
    """(B, n, C) to (B, T * rows per frame, C) on the grid that `spec` names."""
    if spec.frame_grid == "pairs":
        return drop_odd_feature(features)
    return interpolate_to_frames(features, spec.feature_rate, fps)


def to_motion(features: Tensor, spec: SpeechEncoderSpec, n_frames: int) -> Tensor:
    """(B, n, C) to (B, T * rows per frame, C) for motion of `n_frames`, as the public code trains.

    Pairs are cut to the motion, T = `n_frames` at most. Interpolated features are stretched to it,
    T = `n_frames`, whatever the rates say.
    """
    if spec.frame_grid == "pairs":
        return drop_odd_feature(features)[:, : 2 * n_frames]
    stretched = functional.interpolate(
        features.transpose(1, 2), size=n_frames, mode="linear", align_corners=True
    )
    return stretched.transpose(1, 2)


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


def frames_of(n_features: int, spec: SpeechEncoderSpec, fps: float) -> int:
    """Frames that `n_features` give; 0 when there are too few for one."""
    if spec.frame_grid == "pairs":
        return n_features // 2
    return int(n_features / spec.feature_rate * fps)
