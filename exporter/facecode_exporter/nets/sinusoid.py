"""The sine/cosine position table that both halves of CodeTalker use."""

from __future__ import annotations

import math

import torch
from torch import Tensor


def sinusoid(n_rows: int, dim: int) -> Tensor:
    """Position code of Vaswani et al. 2017, section 3.5: (n_rows, dim) float32."""
    position = torch.arange(n_rows, dtype=torch.float32)[:, None]
    rate = torch.exp(torch.arange(0, dim, 2, dtype=torch.float32) * (-math.log(10_000.0) / dim))
    table = torch.zeros(n_rows, dim)
    table[:, 0::2] = torch.sin(position * rate)
    table[:, 1::2] = torch.cos(position * rate)[:, : dim // 2]
    return table
