"""The pre-norm transformer of the VQ autoencoder, (B, T, E) to (B, T, E).

Attribute names are those of the public checkpoints.
"""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional as F


class Attention(nn.Module):
    """Unmasked multi-head attention, scaled by the full width (not the head's) ** -0.5."""

    def __init__(self, dim: int, n_heads: int) -> None:
        super().__init__()
        self.dim, self.n_heads = dim, n_heads
        self.to_qkv = nn.Linear(dim, 3 * dim, bias=False)
        self.to_out = nn.Linear(dim, dim)

    def forward(self, x: Tensor) -> Tensor:
        """(B, T, E) to (B, T, E), every frame attending to all T."""
        query, key, value = self.to_qkv(x).chunk(3, dim=-1)
        return self.attend(query, key, value)

    def attend(self, query: Tensor, key: Tensor, value: Tensor) -> Tensor:
        """Queries (B, n, E) over keys and values (B, T, E), then the output layer."""
        split = (self.n_heads, -1)
        query, key, value = (t.unflatten(-1, split).transpose(1, 2) for t in (query, key, value))
        weights = torch.softmax(query @ key.transpose(-1, -2) * self.dim**-0.5, dim=-1)
        mixed = (weights @ value).transpose(1, 2).flatten(2)
        return cast(Tensor, self.to_out(mixed))


class Mlp(nn.Module):
    """Two linear layers with the tanh form of GELU between."""

    def __init__(self, dim: int, dim_feedforward: int) -> None:
        super().__init__()
        self.l1 = nn.Linear(dim, dim_feedforward)
        self.l2 = nn.Linear(dim_feedforward, dim)

    def forward(self, x: Tensor) -> Tensor:
        """(..., E) to (..., E)."""
        return cast(Tensor, self.l2(F.gelu(self.l1(x), approximate="tanh")))


class PreNorm(nn.Module):
    """Layer norm, then `fn`."""

    def __init__(self, dim: int, fn: nn.Module) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(dim)
        self.fn = fn

    def forward(self, x: Tensor) -> Tensor:
        """(B, T, E) to (B, T, E)."""
        return cast(Tensor, self.fn(self.norm(x)))


class Residual(nn.Module):
    """`x + fn(x)`."""

    def __init__(self, fn: nn.Module) -> None:
        super().__init__()
        self.fn = fn

    def forward(self, x: Tensor) -> Tensor:
        """(B, T, E) to (B, T, E)."""
        return x + cast(Tensor, self.fn(x))


class Transformer(nn.Module):
    """Pre-norm layers; `net` alternates attention and MLP."""

    def __init__(self, dim: int, n_layers: int, n_heads: int, dim_feedforward: int) -> None:
        super().__init__()
        self.net = nn.ModuleList()
        for _ in range(n_layers):
            self.net.append(Residual(PreNorm(dim, Attention(dim, n_heads))))
            self.net.append(Residual(PreNorm(dim, Mlp(dim, dim_feedforward))))

    def forward(self, x: Tensor) -> Tensor:
        """(B, T, E) to (B, T, E)."""
        for layer in self.net:
            x = layer(x)
        return x
