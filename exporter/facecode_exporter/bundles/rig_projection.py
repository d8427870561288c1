"""Weights without vertices: what takes a hidden frame to the products that weights are solved from.

Comes in: the vertex head of a part, which is linear, and the units of a rig. Goes out: a matrix.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Float32, Indices
from facecode.session import Graph


def rig_projection(
    vertex_head: Graph, n_hidden: int, deltas: Float32, vertices: Indices | None
) -> NDArray[np.float64]:
    """(K, E + 1): products of a frame's offsets with each unit, by hidden column, and a constant.

    Args:
        vertex_head: hidden frames (1, n, E) to offsets, in float32.
        n_hidden: E.
        deltas: (K, V, 3) of the whole face.
        vertices: (n,) of the part; None: all.
    """
    own = deltas if vertices is None else deltas[:, vertices]
    flat = own.reshape(len(own), -1).astype(np.float64)
    inputs = np.concatenate([np.zeros((1, n_hidden)), np.eye(n_hidden)]).astype(np.float32)
    offsets = vertex_head.run(("offsets",), hidden=inputs[None])[0][0].astype(np.float64)
    constant, *columns = offsets.reshape(len(offsets), -1) @ flat.T
    return np.stack([*(column - constant for column in columns), constant], axis=1)
