"""Curves against curves, and motion that jumps: lag, correlation and acceleration.

Comes in: arrays over the frames of one clip. Goes out: numbers. Knows nothing of speech.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import AnyArray

LONGEST_LAG = 10
"""Frames, either way, that `lag_correlations` tries."""
FEWEST_OVERLAP = 8
"""Frames that must overlap for a correlation to mean something."""
POP_PERCENTILE = 99.0
CHUNK = 64
Correlations = NDArray[np.float64]


@dataclass(frozen=True)
class Lag:
    """How late a curve is, in frames (negative: early), and its correlation there."""

    frames: int
    correlation: float


def lag_correlations(
    curve: AnyArray, reference: AnyArray, longest: int = LONGEST_LAG
) -> Correlations:
    """Pearson correlation of `curve[t + lag]` with `reference[t]`, (2 * longest + 1,).

    Entry i belongs to lag i - longest. Frames without a partner fall away at both ends; where
    fewer than 8 remain, or either side is constant, the entry is NaN.
    """
    result = np.full(2 * longest + 1, np.nan)
    for i, lag in enumerate(range(-longest, longest + 1)):
        late, early = curve[max(lag, 0) :], reference[max(-lag, 0) :]
        n = min(len(late), len(early))
        if n >= FEWEST_OVERLAP:
            result[i] = pearson(late[:n], early[:n])
    return result


def best_lag(clips: Iterable[Correlations]) -> Lag | None:
    """The lag whose correlation, averaged over clips, is the highest; of equals the smallest shift.

    Clips count alike; NaN entries are left out of the average. None where nothing is defined.
    """
    rows = np.array(list(clips), dtype=np.float64).reshape(-1, 2 * LONGEST_LAG + 1)
    defined = np.isfinite(rows)
    if not defined.any():
        return None
    n = defined.sum(axis=0)
    mean = np.where(n > 0, np.where(defined, rows, 0).sum(axis=0) / np.maximum(n, 1), -np.inf)
    lags = np.arange(-LONGEST_LAG, LONGEST_LAG + 1)
    best = max(range(len(lags)), key=lambda i: (round(float(mean[i]), 9), -abs(lags[i])))
    return Lag(int(lags[best]), float(mean[best]))


def accelerations(vertices: AnyArray, fps: float) -> NDArray[np.float64]:
    """One value for each inner frame, (T - 2,): root mean square over vertices of |acceleration|.

    The acceleration of a vertex at frame t is (x[t+1] - 2 x[t] + x[t-1]) * fps^2, in mesh units
    per s^2. A mean over vertices, not their percentile: a pop that moves a third of the mesh in one
    frame must not vanish among the vertices that never move.
    """
    n_inner = max(len(vertices) - 2, 0)
    result = np.zeros(n_inner)
    for start in range(0, n_inner, CHUNK):
        x = vertices[start : min(start + CHUNK, n_inner) + 2].astype(np.float64)
        second = (x[2:] - 2 * x[1:-1] + x[:-2]) * fps**2
        result[start : start + CHUNK] = np.sqrt(np.square(second).sum(axis=2).mean(axis=1))
    return result


def pops(vertices: AnyArray, fps: float) -> float | None:
    """99th percentile over frames of `accelerations`, in mesh units per s^2; None below 3 frames.

    A pop shows in three frames, so that at 30 fps one in ten seconds decides the number.
    """
    if len(vertices) < 3:
        return None
    return float(np.percentile(accelerations(vertices, fps), POP_PERCENTILE))


def pearson(a: AnyArray, b: AnyArray) -> float:
    """Correlation of two curves of the same length; NaN where either is constant."""
    if not np.ptp(a) or not np.ptp(b):
        return float("nan")
    a, b = (x.astype(np.float64) - x.mean(dtype=np.float64) for x in (a, b))
    return float(a @ b / np.sqrt((a @ a) * (b @ b)))
