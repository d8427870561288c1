"""ARKit's 52 face units in the order of the formats that know them by position.

Comes in: weights under the names of a rig. Goes out: weights (T, 52) in ARKit's order. Knows
nothing of files.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facecode.arrays import Float32
from facecode.errors import UnitNamesError

NAMES = tuple(
    """
    eyeBlinkLeft eyeLookDownLeft eyeLookInLeft eyeLookOutLeft eyeLookUpLeft eyeSquintLeft
    eyeWideLeft eyeBlinkRight eyeLookDownRight eyeLookInRight eyeLookOutRight eyeLookUpRight
    eyeSquintRight eyeWideRight jawForward jawRight jawLeft jawOpen mouthClose mouthFunnel
    mouthPucker mouthRight mouthLeft mouthSmileLeft mouthSmileRight mouthFrownLeft
    mouthFrownRight mouthDimpleLeft mouthDimpleRight mouthStretchLeft mouthStretchRight
    mouthRollLower mouthRollUpper mouthShrugLower mouthShrugUpper mouthPressLeft
    mouthPressRight mouthLowerDownLeft mouthLowerDownRight mouthUpperUpLeft mouthUpperUpRight
    browDownLeft browDownRight browInnerUp browOuterUpLeft browOuterUpRight cheekPuff
    cheekSquintLeft cheekSquintRight noseSneerLeft noseSneerRight tongueOut
    """.split()  # noqa: SIM905
)
"""As the app Live Link Face orders them: right before left in jaw and mouth."""


def pascal(name: str) -> str:
    """`JawOpen` of `jawOpen`."""
    return name[:1].upper() + name[1:]


def columns(names: Sequence[str], suffix: str) -> list[int | None]:
    """For each of NAMES its column in a rig of `names`; None: the rig has no such unit.

    Raises:
        UnitNamesError: the rig has none of them.
    """
    where = {name.casefold(): index for index, name in enumerate(names)}
    found = [where.get(name.casefold()) for name in NAMES]
    if all(column is None for column in found):
        raise UnitNamesError(
            f"{suffix} holds ARKit's 52 units, and this rig has none of them: got "
            f"{', '.join(names[:5])}; name them as ARKit does (jawOpen, ...), or write .glb"
        )
    return found


def in_order(weights: Float32, found: Sequence[int | None]) -> Float32:
    """Weights (T, 52) in the order of NAMES, 0 for units that the rig lacks."""
    ordered = np.zeros((len(weights), len(NAMES)), np.float32)
    for place, column in enumerate(found):
        if column is not None:
            ordered[:, place] = weights[:, column]
    return ordered
