"""Motion to weights of face units: least squares in the box from 0 to 1, frame by frame.

Comes in: offsets and the deltas of a rig. Goes out: the weights (T, K) that are nearest to the
motion. All frames are solved at once by block principal pivoting (Kim and Park, SIAM J. Sci.
Comput. 2011, here with bounds on both sides); where whole blocks go in circles, Murty's rule of one
variable at a time takes over, which ends. Knows nothing of names, bundles or files.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Float32, Offsets

RIDGE = 1e-4
"""Added to the diagonal, as a share of its mean: settles ties between units at no visible cost."""
CHUNK = 64  # frames solved at once: (64, K, K) float64
BLOCK_TRIES = 3  # steps without fewer violations until one variable moves at a time
TOLERANCE = 1e-9  # of a bound or a gradient, relative to their scale

Float64 = NDArray[np.float64]
LOWER, FREE, UPPER = 0, 1, 2


@dataclass(frozen=True)
class WeightProblem:
    """The box problem of a rig: what weights of its units are solved from."""

    gram: Float64
    """(K, K) products of the units, with the ridge, over `scale`"""
    scale: float
    """The mean square of the units; 0: no unit moves anything."""

    @classmethod
    def of(cls, deltas: Float32, ridge: float = RIDGE) -> WeightProblem:
        """Of units (K, V, 3), with `ridge` of the mean diagonal added to it."""
        flat = deltas.reshape(len(deltas), -1).astype(np.float64)
        gram = flat @ flat.T
        scale = float(np.trace(gram)) / len(gram)
        gram[np.diag_indices_from(gram)] += ridge * scale + np.finfo(np.float64).tiny
        return cls(gram / scale if scale else gram, scale)

    def solve(
        self, products: Float64, temporal: float = 0, cancel: Sequence[tuple[int, int]] = ()
    ) -> Float32:
        """Products (T, K) of offsets with the units to weights (T, K) float32 in [0, 1].

        Args:
            products: of all frames.
            temporal: see `solve_weights`.
            cancel: see `solve_weights`.
        """
        weights = np.zeros(products.shape, np.float32)
        if not self.scale:
            return weights
        n = 1 if temporal else CHUNK  # frames that do not wait for each other
        gram, drawn = self.gram, self.gram + temporal * np.eye(len(self.gram))
        before: Float64 = np.zeros((1, len(gram)))
        for start in range(0, len(products), n):
            wanted = products[start : start + n] / self.scale
            if temporal and start:
                gram, wanted = drawn, wanted + temporal * before
            before = _solve(gram, wanted, cancel)
            weights[start : start + n] = before
        return weights


def solve_weights(
    offsets: Offsets,
    deltas: Float32,
    ridge: float = RIDGE,
    temporal: float = 0,
    cancel: Sequence[tuple[int, int]] = (),
) -> Float32:
    """Weights (T, K) float32 in [0, 1] for which `weights @ deltas` is nearest to the offsets.

    The defaults serve the units of the packaged bundles, whose motion lies in their span. Units of
    one's own may ask for more: with m the mean of the squares of the deltas, frame t minimises
    `|w D - o|^2 + m ridge |w|^2 + m temporal |w - w_before|^2` in the box, exactly.

    Args:
        offsets: (T, V, 3), from the neutral face.
        deltas: (K, V, 3), what each unit moves at weight 1, in the same unit.
        ridge: draws weights to 0.
        temporal: draws weights to those of the frame before; frames are then solved in turn. The
            first frame has none before it.
        cancel: pairs of units (i, j) that must not act at once, such as jawLeft and jawRight: the
            smaller of the two is held at 0, the second where they are equal, and the others are
            solved again.
    """
    flat = deltas.reshape(len(deltas), -1).astype(np.float64)
    products = np.empty((len(offsets), len(deltas)))
    for start in range(0, len(offsets), CHUNK):
        chunk = slice(start, start + CHUNK)
        products[chunk] = offsets[chunk].reshape(len(offsets[chunk]), -1).astype(float) @ flat.T
    return WeightProblem.of(deltas, ridge).solve(products, temporal, cancel)


def _solve(gram: Float64, wanted: Float64, cancel: Sequence[tuple[int, int]]) -> Float64:
    weights = solve_box(gram, wanted)
    if not cancel:
        return weights
    held = np.zeros(wanted.shape, bool)
    for one, other in cancel:
        first_is_smaller = weights[:, one] < weights[:, other]
        held[first_is_smaller, one] = True
        held[~first_is_smaller, other] = True
    return solve_box(gram, wanted, held)


def solve_box(gram: Float64, wanted: Float64, held: NDArray[np.bool_] | None = None) -> Float64:
    """Minimise w H w / 2 - g w over 0 <= w <= 1 for every row g of `wanted` (T, K).

    A row gives the same bits alone and among others.

    Args:
        gram: H (K, K), symmetric and positive definite.
        wanted: g of each frame, (T, K).
        held: (T, K), which weights stay at 0; none by default.
    """
    n_frames, n_units = wanted.shape
    place = np.full(wanted.shape, LOWER)
    fewest = np.full(n_frames, n_units + 1)
    tries = np.full(n_frames, BLOCK_TRIES)
    weights = np.zeros(wanted.shape)
    active = np.arange(n_frames)
    scale = TOLERANCE * np.maximum(1.0, np.abs(wanted).max(axis=1, initial=0, keepdims=True))
    while len(active):
        weights[active] = _with_places(gram, wanted[active], place[active])
        moves = _violations(gram, wanted[active], weights[active], place[active], scale[active])
        if held is not None:
            moves[held[active]] = -1
        count = (moves >= 0).sum(axis=1)
        better = count < fewest[active]
        tries[active] = np.where(better, BLOCK_TRIES, tries[active] - 1)
        fewest[active] = np.minimum(count, fewest[active])
        one_at_a_time = tries[active] < 0
        last = n_units - 1 - np.argmax(moves[:, ::-1] >= 0, axis=1)
        alone = np.zeros(moves.shape, bool)
        alone[np.arange(len(active)), last] = True
        moving = (moves >= 0) & (alone | ~one_at_a_time[:, None])
        place[active] = np.where(moving, moves, place[active])
        active = active[count > 0]
    return np.clip(weights, 0, 1)


def _with_places(gram: Float64, wanted: Float64, place: NDArray[np.int64]) -> Float64:
    """The free weights of each frame, the others at their bounds."""
    free, bound = place == FREE, np.where(place == UPPER, 1.0, 0.0)
    both = free[:, :, None] & free[:, None, :]
    matrix = np.where(both, gram, np.eye(len(gram)))
    right = np.where(free, wanted - _rows(bound, gram), bound)
    return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0])


def _rows(rows: Float64, gram: Float64) -> Float64:
    """`rows @ gram` with sums in one order: BLAS takes another for another number of rows."""
    return np.asarray(np.einsum("tk,kj->tj", rows, gram))


def _violations(
    gram: Float64, wanted: Float64, weights: Float64, place: NDArray[np.int64], scale: Float64
) -> NDArray[np.int64]:
    """Where each weight must move to, -1 for those that fit."""
    gradient = _rows(weights, gram) - wanted
    moves = np.full(place.shape, -1)
    moves[(place == FREE) & (weights < -TOLERANCE)] = LOWER
    moves[(place == FREE) & (weights > 1 + TOLERANCE)] = UPPER
    moves[(place == LOWER) & (gradient < -scale)] = FREE
    moves[(place == UPPER) & (gradient > scale)] = FREE
    return moves
