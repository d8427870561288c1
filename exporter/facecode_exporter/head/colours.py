"""Which material each vertex of the demo head shows, and what the materials look like.

Comes in: the base mesh's skin and its texture masks. Goes out: shares of materials that blend, so
that one head serves several complexions. The colours are ours. Knows nothing of shapes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from facecode_exporter.head.anny_wheel import Float

MATERIALS = (
    *(
        "skin",
        "blush",
        "lips",
        "mouth",
        "hair",
        "brow",
        "lash",
        "tongue",
        "tongue_root",
        "gum",
        "teeth",
    ),
    *("tooth_seam", "tooth_shade", "sclera", "iris_rim", "iris", "iris_inner", "pupil"),
)
MASKS = ("lips", "inside-mouth", "ears")
# Depth z and height y of the edge of the hair, from the nape to the forehead (decimetres).
HAIRLINE = (
    (-0.75, -0.30, -0.05, 0.15, 0.40, 0.55, 0.75, 0.95, 1.10, 1.50),
    (6.45, 6.55, 6.90, 7.15, 7.22, 7.40, 7.62, 7.90, 8.05, 8.12),
)
Colour = tuple[int, int, int]

_FIXED: dict[str, Colour] = {
    "mouth": (84, 30, 32),
    "lash": (38, 26, 24),
    "tongue": (168, 82, 84),
    "tongue_root": (96, 42, 44),
    "gum": (178, 98, 98),
    "teeth": (240, 234, 222),
    "tooth_seam": (176, 160, 146),
    "tooth_shade": (104, 70, 66),
    "sclera": (240, 238, 234),
    "pupil": (12, 10, 10),
}


def palette(
    skin: Colour, blush: Colour, lips: Colour, hair: Colour, iris: Colour
) -> NDArray[np.uint8]:
    """(n_materials, 3) sRGB of one complexion."""
    chosen = {
        **_FIXED,
        **{"skin": skin, "blush": blush, "lips": lips, "hair": hair, "iris": iris},
        "brow": _mixed(hair, skin, 0.15),
        "iris_rim": _mixed(iris, (0, 0, 0), 0.6),
        "iris_inner": _mixed(iris, (255, 214, 150), 0.3),
    }
    return np.array([chosen[name] for name in MATERIALS], np.uint8)


def _mixed(a: Colour, b: Colour, share: float) -> Colour:
    red, green, blue = (round((1 - share) * x + share * y) for x, y in zip(a, b, strict=True))
    return red, green, blue


def paint_skin(skin: Float, masks: Mapping[str, Float], lid_edges: Float) -> dict[str, Float]:
    """Shares of materials over the skin (n, 3), decimetres of the base mesh.

    Args:
        skin: vertices.
        masks: the texture masks at the vertices, (n,) in [0, 1].
        lid_edges: points along the edges of the lids; skin beside them is dark, as lashes make it.
    """
    x, y, z = np.abs(skin[:, 0]), skin[:, 1], skin[:, 2]
    mouth = _ramp(masks["inside-mouth"], 0.2, 0.8)
    lips = _ramp(masks["lips"], 0.2, 0.8)
    to_lid = np.linalg.norm(skin[:, None] - lid_edges, axis=2).min(axis=1)
    shares = {
        "mouth": mouth,
        "lips": lips,
        "lash": 0.85 * _ramp(-to_lid, -0.030, -0.012),
        "hair": 0.92 * _hair(y, z, _ramp(masks["ears"], 0.2, 0.8)),
        "blush": 0.35 * _blush(x, y, z),
    }
    return _stacked(shares)


def _hair(y: Float, z: Float, ear: Float) -> Float:
    """Short hair: above a line that runs from the forehead over the temples to behind the ears."""
    hairline = np.interp(z, *HAIRLINE)
    return _ramp(y - hairline, -0.12, 0.16) * (1 - ear)


def _blush(x: Float, y: Float, z: Float) -> Float:
    cheek = np.exp(-(((x - 0.42) / 0.17) ** 2) - ((y - 6.93) / 0.15) ** 2)
    nose = np.exp(-((x / 0.12) ** 2) - ((y - 6.93) / 0.10) ** 2)
    return np.where(z > 0.8, np.maximum(cheek, 0.8 * nose), 0)


def _stacked(shares: Mapping[str, Float]) -> dict[str, Float]:
    """Earlier materials cover later ones; what is left is skin."""
    left = np.ones_like(next(iter(shares.values())))
    covered = {}
    for name, share in shares.items():
        covered[name] = left * share
        left = left * (1 - share)
    return {**covered, "skin": left}


def _ramp(value: Float, low: float, high: float) -> Float:
    t = np.clip((value - low) / (high - low), 0, 1)
    return np.asarray(t * t * (3 - 2 * t))


def as_bytes(parts: Sequence[Mapping[str, Float]]) -> dict[str, NDArray[np.uint8]]:
    """Material -> (V,) shares of 255 that sum to 255 at each vertex; parts one after the other."""
    columns = [
        np.concatenate([part.get(name, np.zeros_like(next(iter(part.values())))) for part in parts])
        for name in MATERIALS
    ]
    table = np.floor(255 * np.stack(columns, axis=1)).astype(np.int64)
    table[np.arange(len(table)), table.argmax(axis=1)] += 255 - table.sum(axis=1)
    return {name: table[:, k].astype(np.uint8) for k, name in enumerate(MATERIALS)}


PALETTES = {
    ("caucasian", "female"): palette(
        (236, 196, 174), (226, 150, 134), (192, 110, 106), (92, 62, 44), (88, 122, 140)
    ),
    ("caucasian", "male"): palette(
        (226, 184, 160), (214, 142, 124), (186, 112, 104), (74, 52, 40), (96, 112, 84)
    ),
    ("asian", "female"): palette(
        (238, 202, 170), (228, 158, 134), (194, 108, 102), (34, 28, 28), (74, 48, 34)
    ),
    ("asian", "male"): palette(
        (222, 182, 146), (206, 144, 116), (180, 108, 98), (30, 26, 26), (66, 44, 32)
    ),
    ("african", "female"): palette(
        (146, 98, 72), (150, 80, 62), (142, 74, 70), (32, 25, 24), (62, 38, 26)
    ),
    ("african", "male"): palette(
        (118, 78, 58), (120, 66, 52), (116, 68, 62), (28, 22, 22), (54, 34, 24)
    ),
}
GREY_HAIR = np.array((168, 164, 160))


def palette_of(ethnicity: str, sex: str, age: str) -> NDArray[np.uint8]:
    """The complexion of one identity; the old are grey."""
    chosen = PALETTES[ethnicity, sex].copy()
    if age == "old":
        for name, grey in (("hair", 0.85), ("brow", 0.55)):
            row = MATERIALS.index(name)
            chosen[row] = np.rint((1 - grey) * chosen[row] + grey * GREY_HAIR)
    return np.asarray(chosen)
