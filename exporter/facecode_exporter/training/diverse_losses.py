"""The losses of CDFace (Gu et al. 2024) for one part: K samples X^k of a true clip X.

Motion is (B, K, T, 3V), or (B, T, 3V) for the truth, in units of the training motion's root mean
square, so that weights mean the same for any mesh. All distances are means over frames and
coordinates: the length of a crop changes none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

TERMS = (
    *("diversity", "reconstruction", "every_sample", "closure", "regulariser"),
    "target_code",
)


@dataclass(frozen=True)
class DiverseLosses:
    """Weights and shapes of the terms; saved with the run.

    The paper's prose names the terms; the copy at hand had lost its formulas, so that every number
    here, and what `half_at` and `every_sample` say, are choices of this project.
    """

    diversity: float = 0.06
    """Weight, times K, of exp(-d^2 / sigma) of the closest pair over the whole clip (after Eq. 4).
    Only one pair of a clip is pushed, while closed frames are supervised in K samples: with the
    weight of 5, 15 heads stayed together."""
    half_at: float = 0.45
    """Distance of the closest pair, as a share of the motion's root mean square, at which that term
    is 0.5; it sets sigma. With `diversity` and `every_sample` it says where samples settle: where
    a step apart gains as much as it costs, here at about 0.8."""
    every_sample: float = 0.12
    """Weight of the mean error of all samples. Zero is best-of-K alone, under which heads that
    never win hear nothing of the speech (relaxed winner-takes-all, Rupprecht et al. 2017)."""
    closure: float = 1.0
    """Weight of the error in closed frames, summed over samples (after Eq. 12)."""
    regulariser: float = 0.25
    """Weight of the distance of predicted features to their code vectors; as the commitment of the
    motion prior."""
    target_code: float = 1.0
    """Weight of the distance of features to the code vectors that the prior's encoder gives the
    truth: of the best sample everywhere, of the others where the mouth is closed. CodeTalker's
    stage 2 has this term with this weight; the paper's prose names none. An earlier training
    without it, of fewer epochs, left the best sample twice as far from the truth."""
    mask: bool = True
    """Lips: frames in which the true mouth is closed carry no diversity and are supervised in every
    sample. False is the paper's ablation."""
    closed_below: float = 0.15
    """Opening, as a share of a subject's 95th percentile, up to which a mouth is closed. Zero would
    never be met: lips at rest are not zero apart."""


def diverse_terms(
    samples: Tensor,
    truth: Tensor,
    open_mouth: Tensor,
    features: Tensor,
    vectors: Tensor,
    true_vectors: Tensor,
    half_at: float,
) -> list[Tensor]:
    """The terms of TERMS, unweighted.

    Args:
        samples: (B, K, T, 3V).
        truth: (B, T, 3V).
        open_mouth: (B, T), 1 where diversity is allowed, 0 where the truth binds every sample.
        features: (B, K, T, H, C) that the network gave.
        vectors: their nearest code vectors.
        true_vectors: (B, T, H, C) code vectors of the truth.
        half_at: of `DiverseLosses`.
    """
    error = (samples - truth[:, None]).square().mean(dim=-1)
    per_sample = error.mean(dim=-1)
    smallest, best = per_sample.min(dim=1)
    closed = (1 - open_mouth)[:, None]
    bound = torch.where(_is_sample(best, samples.shape[1]), 1.0, closed)
    to_truth = (features - true_vectors.detach()[:, None]).square().mean(dim=(-2, -1))
    return [
        diversity(samples * open_mouth[:, None, :, None], half_at),
        smallest.mean(),
        per_sample.mean(),
        (closed * error).mean(dim=(0, 2)).sum(),
        (features - vectors.detach()).square().mean(),
        (bound * to_truth).mean(dim=(0, 2)).sum(),
    ]


def _is_sample(index: Tensor, n_samples: int) -> Tensor:
    """(B, K, 1): whether k is `index` (B,)."""
    return (torch.arange(n_samples) == index[:, None])[..., None]


def diversity(samples: Tensor, half_at: float) -> Tensor:
    """Mean over clips of exp(-d^2 / sigma), d the closest pair's distance; 0 for one sample."""
    n_samples = samples.shape[1]
    if n_samples == 1:
        return samples.new_zeros(())
    first, second = _closest(samples.detach())
    row = torch.arange(len(samples))
    squared = (samples[row, first] - samples[row, second]).square().mean(dim=(-2, -1))
    sigma = half_at**2 / math.log(2)
    return torch.exp(-squared / sigma).mean()


def _closest(samples: Tensor) -> tuple[Tensor, Tensor]:
    """(B,) and (B,): which two samples are closest in each clip."""
    flat = samples.flatten(2)
    first, second = torch.triu_indices(flat.shape[1], flat.shape[1], offset=1)
    closest = torch.cdist(flat, flat)[:, first, second].argmin(dim=1)
    return first[closest], second[closest]


def total(terms: list[Tensor], weights: DiverseLosses, n_samples: int) -> Tensor:
    """The weighted sum; reconstruction counts once."""
    each = (
        *(weights.diversity * n_samples, 1.0, weights.every_sample, weights.closure),
        *(weights.regulariser, weights.target_code),
    )
    return torch.stack([w * t for w, t in zip(each, terms, strict=True)]).sum()
