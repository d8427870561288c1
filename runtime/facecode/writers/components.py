"""A motion without named units as a few shapes and their weights.

Comes in: the motion of one face, or of several takes of it. Goes out: shapes in the order of what
they explain (principal components), weights in [0, 1], and the greatest error. Weights have no
sign because Blender and Unity clamp them to [0, 1]: each component is shifted by its minimum,
which moves into the face at rest. Knows nothing of files.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Float32, Offsets

CHUNK = 256  # frames at a time
DISCARDED = 0.01  # share of the tolerance that a merge of chunks may lose


@dataclass(frozen=True)
class Components:
    """K shapes: frame t is `rest + weights[t] @ shapes`."""

    rest: Float32
    """(V, 3) displacement of the template where all weights are 0."""
    shapes: Float32
    """(K, V, 3)"""
    weights: tuple[Float32, ...]
    """(T, K) in [0, 1] for each motion"""
    error: float
    """The greatest distance of a vertex from where it should be, over all frames."""


def components_of(motions: Sequence[Offsets], tolerance: float) -> Components:
    """The fewest principal components that put every vertex within `tolerance`, at least one.

    Args:
        motions: offsets (T, V, 3) of one or more takes on the same V.
        tolerance: in their unit.
    """
    flat = [motion.reshape(len(motion), -1) for motion in motions]
    n_frames = sum(map(len, flat))
    mean = np.sum([motion.sum(axis=0, dtype=np.float64) for motion in flat], axis=0) / n_frames
    centre = np.asarray(mean, np.float32)
    axes = _axes(flat, centre, tolerance * DISCARDED)
    n_shapes = _count(flat, centre, axes, tolerance)
    while True:
        found = _shifted(flat, centre, axes[:n_shapes])
        if found.error <= tolerance or n_shapes == len(axes):
            return found
        n_shapes += 1


def _axes(motions: Sequence[Float32], centre: Float32, lost: float) -> Float32:
    """(R, 3V) orthonormal directions, the strongest first, that leave `lost` of a chunk at most.

    Chunks are merged one after the other: singular vectors of what is kept and the next chunk,
    from the Gram matrix of their rows, which is small.
    """
    kept = np.zeros((0, len(centre)))
    for chunk in _chunks(motions, centre):
        rows = np.concatenate([kept, chunk])
        energy, mix = np.linalg.eigh(rows @ rows.T)
        n_lost = int(np.searchsorted(np.cumsum(np.maximum(energy, 0)), lost**2))
        n_kept = max(len(energy) - n_lost, 1)
        kept = mix[:, ::-1][:, :n_kept].T @ rows
    length = np.linalg.norm(kept, axis=1, keepdims=True)
    return np.asarray(kept / np.where(length > 0, length, 1), np.float32)


def _count(motions: Sequence[Float32], centre: Float32, axes: Float32, tolerance: float) -> int:
    """The fewest axes that suffice for each chunk.

    While the vertices of a frame are too far off in the mean, one of them is: that needs no frame.
    """
    n_axes = 1
    for chunk in _chunks(motions, centre):
        along = chunk @ axes.T
        explained = np.cumsum(np.square(along, dtype=np.float64), axis=1)
        energy = np.einsum("tv,tv->t", chunk, chunk, dtype=np.float64)
        left = (energy[:, None] - explained).max(axis=0) / (len(centre) // 3)
        too_far = np.count_nonzero(left[: len(axes) - 1] > tolerance**2)
        n_axes = max(n_axes, too_far + 1)
        rest = chunk - along[:, :n_axes] @ axes[:n_axes]
        while n_axes < len(axes) and _greatest(rest) > tolerance:
            rest -= np.outer(along[:, n_axes], axes[n_axes])
            n_axes += 1
    return n_axes


def _shifted(motions: Sequence[Float32], centre: Float32, axes: Float32) -> Components:
    along = [
        np.concatenate([chunk @ axes.T for chunk in _chunks([motion], centre)])
        for motion in motions
    ]
    low = np.min([each.min(axis=0) for each in along], axis=0)
    reach = np.max([each.max(axis=0) for each in along], axis=0) - low
    weights = [np.clip((each - low) / np.where(reach > 0, reach, 1), 0, 1) for each in along]
    rest, shapes = centre + low @ axes, reach[:, None] * axes
    error = 0.0
    for motion, weight in zip(motions, weights, strict=True):
        for start in range(0, len(motion), CHUNK):
            made = rest + weight[start : start + CHUNK] @ shapes
            error = max(error, _greatest(made - motion[start : start + CHUNK]))
    n_vertices = len(centre) // 3
    return Components(
        rest.reshape(n_vertices, 3),
        shapes.reshape(-1, n_vertices, 3),
        tuple(weights),
        error,
    )


def _chunks(motions: Sequence[Float32], centre: Float32) -> Iterator[Float32]:
    for motion in motions:
        for start in range(0, len(motion), CHUNK):
            yield motion[start : start + CHUNK] - centre


def _greatest(rest: NDArray[np.float32]) -> float:
    """The longest of displacements (T, 3V)."""
    x, y, z = (rest[:, axis::3] for axis in range(3))
    return float(np.sqrt((x * x + y * y + z * z).max()))
