"""Where files of other programs want a face: in metres, y up, z to the front.

Comes in: points or displacements in a clip's unit and axes. Goes out: the same, turned and scaled.
Knows nothing of files.
"""

from __future__ import annotations

import numpy as np

from facecode.arrays import Float32
from facecode.clip import Clip

_TURNS = {"x": ((1, -1), (0, 1), (2, 1)), "z": ((0, 1), (2, 1), (1, -1))}
"""For each new axis the old one and its sign. A quarter turn: a swap of axes would mirror."""


def metres_y_up(clip: Clip, points: Float32) -> Float32:
    """Points (..., 3) of a clip in metres with y up.

    A unit that is not known is taken as the metre, an axis that is not known as y.
    """
    scaled = np.asarray(points * metres_per_unit(clip), np.float32)
    turn = _TURNS.get(clip.up_axis or "y")
    if turn is None:
        return scaled
    columns = [scaled[..., axis] * np.float32(sign) for axis, sign in turn]
    return np.asarray(np.stack(columns, axis=-1), np.float32)


def metres_per_unit(clip: Clip) -> float:
    """What lengths of a clip are multiplied by; 1 where the unit is not known."""
    return 1.0 if clip.metres_per_unit is None else clip.metres_per_unit
