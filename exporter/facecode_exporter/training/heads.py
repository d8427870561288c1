"""The heads of a part of CDFace: from one to all, and in which order they stand."""

from __future__ import annotations

import torch
from torch import Tensor

from facecode_exporter.nets.part import PartNet


@torch.no_grad()
def start_from_one(net: PartNet, one: PartNet, spread: float) -> None:
    """Give `net` the weights of `one`, the same network with one head, and K heads near that head.

    Args:
        net: of K samples.
        one: trained with one sample, as the deterministic variant.
        spread: of the noise that sets the heads apart, as a share of the root mean square of the
            head's weights. Copies would never part: at distance 0 nothing pushes.
    """
    state = one.state_dict()
    head = state["feat_map.weight"]
    k = net.part.n_samples
    noise = torch.randn(k, *head.shape, generator=torch.Generator().manual_seed(0))
    heads = head + spread * head.square().mean().sqrt() * noise
    net.load_state_dict({**state, "feat_map.weight": heads.flatten(0, 1)})


@torch.no_grad()
def sort_heads(net: PartNet, errors: Tensor) -> None:
    """Put the head of the smallest error (K,) first: one face alone is that of head 0."""
    heads = net.feat_map.weight.unflatten(0, (net.part.n_samples, -1))
    net.feat_map.weight.copy_(heads[errors.argsort()].flatten(0, 1))
