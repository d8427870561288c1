"""The terms of both stages (CodeTalker, sections 3.1 and 3.2). Tensors (B, T, ...)."""

from __future__ import annotations

from torch import Tensor
from torch.nn import functional as F


def straight_through(features: Tensor, vectors: Tensor) -> Tensor:
    """`vectors` in the forward pass, the gradient of `features` in the backward pass."""
    return features + (vectors - features).detach()


def stage1_terms(
    offsets: Tensor, decoded: Tensor, features: Tensor, vectors: Tensor
) -> list[Tensor]:
    """Reconstruction (L1), codebook and commitment terms."""
    return [
        F.l1_loss(decoded, offsets),
        F.mse_loss(vectors, features.detach()),
        F.mse_loss(features, vectors.detach()),
    ]


def stage2_terms(
    offsets: Tensor, decoded: Tensor, features: Tensor, true_vectors: Tensor, counts: Tensor
) -> list[Tensor]:
    """Motion term on offsets, regularisation to the quantised encoding of the true motion.

    Frames count as often as `counts` (B, T) says.
    """
    return [
        counted_mse(decoded, offsets, counts),
        counted_mse(features, true_vectors.detach(), counts),
    ]


def counted_mse(prediction: Tensor, truth: Tensor, counts: Tensor) -> Tensor:
    """Mean squared error of (B, T, ...) in which frames count as often as `counts` (B, T) says."""
    per_frame = (prediction - truth).square().flatten(2).mean(dim=-1)
    return (counts * per_frame).sum() / counts.sum()
