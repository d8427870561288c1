"""The 52 ARKit face units, in the order of every weight array of the corpus."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

_SIDES = ("Left", "Right")


def _both(*names: str) -> tuple[str, ...]:
    return tuple(name + side for name in names for side in _SIDES)


FACE_UNITS: tuple[str, ...] = (
    *_both("browDown"),
    "browInnerUp",
    *_both("browOuterUp"),
    "cheekPuff",
    *_both("cheekSquint", "eyeBlink", "eyeLookDown", "eyeLookIn", "eyeLookOut", "eyeLookUp"),
    *_both("eyeSquint", "eyeWide"),
    *("jawForward", "jawLeft", "jawOpen", "jawRight", "mouthClose"),
    *_both("mouthDimple", "mouthFrown"),
    *("mouthFunnel", "mouthLeft"),
    *_both("mouthLowerDown", "mouthPress"),
    *("mouthPucker", "mouthRight", "mouthRollLower", "mouthRollUpper"),
    *("mouthShrugLower", "mouthShrugUpper"),
    *_both("mouthSmile", "mouthStretch", "mouthUpperUp", "noseSneer"),
    "tongueOut",
)
UNIT: Mapping[str, int] = {name: index for index, name in enumerate(FACE_UNITS)}


def unit_weights(**weights: float) -> NDArray[np.float32]:
    """(52,) float32 from names; a name without its side (`mouthSmile`) sets both.

    Raises:
        KeyError: no such unit.
    """
    row = np.zeros(len(FACE_UNITS), np.float32)
    for name, weight in weights.items():
        for unit in (name,) if name in UNIT else (name + side for side in _SIDES):
            row[UNIT[unit]] = weight
    return row
