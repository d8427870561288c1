"""A tracked mouth to weights of face units: what the demo head does to look the same.

Comes in: the measures of a mouth, frame by frame. Goes out: (T, 52) weights in [0, 1]. Fifteen
units, left and right alike, are fitted by least squares: the gap nearly exactly, the rest as well
as the units can, smooth in time. What landmarks do not show (how far lips come forward) follows the
tracker's own scores. Knows nothing of landmarks or files.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Float32
from facecode_exporter.head.face_units import unit_weights
from facecode_exporter.head.head import LIP_PAIR, Head

Float64 = NDArray[np.float64]

MEASURES: Mapping[str, float] = {
    "gap": 0.15,
    "width": 0.8,
    "upper_lip": 0.7,
    "chin": 1.2,
    "corners": 1.5,
    "upper_thickness": 1.0,
    "lower_thickness": 1.2,
}
"""What is measured, and how many mm off count alike."""
ROUNDING: Mapping[str, float] = {"mouthPucker": 0.75, "mouthFunnel": 1.2}
"""Units that follow the tracker's scores, and the weight at score 1."""
RELUCTANCE: Mapping[str, float] = {
    "jawOpen": 0.5,
    "mouthClose": 1.0,
    "mouthFunnel": 80.0,
    "mouthPucker": 80.0,
    "mouthRollLower": 10.0,
    "mouthRollUpper": 10.0,
    "mouthShrugLower": 10.0,
    "mouthShrugUpper": 12.0,
    "mouthStretch": 3.0,
    "mouthSmile": 6.0,
    "mouthFrown": 6.0,
    "mouthPress": 3.0,
    "mouthLowerDown": 0.5,
    "mouthUpperUp": 4.0,
    "mouthDimple": 6.0,
}
"""The fitted units, and what weight 1 costs: where several would do, the cheapest moves."""
SMOOTH = 0.3
STEPS = 400
UPPER_EDGE, LOWER_EDGE, CHIN, LEFT_CORNER, RIGHT_CORNER = 466, 492, 1668, 2730, 425
"""Vertices of the demo head on the midline, and the corners of its mouth."""


def fit_mouth(measures_mm: Float64, rounding: Float64, head: Head) -> Float32:
    """(T, 52) weights in [0, 1].

    Args:
        measures_mm: (T, 7) the MEASURES in mm, less those at rest.
        rounding: (T, 2) the tracker's scores of the units of ROUNDING, less those at rest.
        head: the demo head.
    """
    along = unit_measures(head)
    weigh = 1 / np.square(list(MEASURES.values()))
    cost = np.array(list(RELUCTANCE.values()))
    wanted = np.zeros((len(measures_mm), len(RELUCTANCE)))
    for column, (unit, most) in enumerate(ROUNDING.items()):
        wanted[:, list(RELUCTANCE).index(unit)] = np.clip(most * rounding[:, column], 0, 1)
    square = (along * weigh) @ along.T + np.diag(cost)
    linear = (measures_mm * weigh) @ along.T + cost * wanted
    return np.asarray(_in_bounds(square, linear) @ _spread(), np.float32)


def unit_measures(head: Head) -> Float64:
    """(15, 7) what weight 1 of each unit of RELUCTANCE does to the MEASURES, in mm."""
    moved = 1000 * np.tensordot(_spread(), head.unit_offsets.astype(np.float64), 1)
    upper, lower = (moved[:, vertex, 1] for vertex in LIP_PAIR)
    left, right = moved[:, LEFT_CORNER], moved[:, RIGHT_CORNER]
    return np.stack(
        [
            upper - lower,
            left[:, 0] - right[:, 0],
            upper,
            moved[:, CHIN, 1],
            (left[:, 1] + right[:, 1]) / 2,
            moved[:, UPPER_EDGE, 1] - upper,
            lower - moved[:, LOWER_EDGE, 1],
        ],
        axis=1,
    )


def _spread() -> Float64:
    """(15, 52) the fitted units among all, both sides alike."""
    return np.stack([unit_weights(**{name: 1.0}) for name in RELUCTANCE]).astype(np.float64)


def _in_bounds(square: Float64, linear: Float64) -> Float64:
    """argmin over 0 <= w <= 1 of w S w / 2 - l w + SMOOTH times the squared steps between frames.

    An accelerated projected gradient (Beck and Teboulle 2009). (T, n) from (n, n) and (T, n).
    """
    pace = 1 / (np.linalg.eigvalsh(square).max() + 4 * SMOOTH)
    weights = np.zeros_like(linear)
    ahead, momentum = weights, 1.0
    for _ in range(STEPS):
        slope = ahead @ square - linear
        steps = SMOOTH * np.diff(ahead, axis=0)
        slope[:-1] -= steps
        slope[1:] += steps
        fresh = np.clip(ahead - pace * slope, 0, 1)
        later = (1 + np.sqrt(1 + 4 * momentum**2)) / 2
        ahead = fresh + (momentum - 1) / later * (fresh - weights)
        weights, momentum = fresh, later
    return weights
