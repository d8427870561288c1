"""Eyes, teeth and brows of the demo head: the parts that the base mesh has only as rough helpers.

Each follows the helper or the skin that it replaces or lies on. Comes in: the base mesh. Goes out:
parts with, for each vertex, the material it shows.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from facecode_exporter.head.anny_wheel import Float, Int
from facecode_exporter.head.pieces import Part, attached, copied, grid_triangles, sphere_of

N_MERIDIANS = 20
# Angles from the line of sight. Two rings a degree apart make the edges of pupil and iris crisp.
EYE_RINGS = (
    (2.0, "pupil"),
    (9.0, "pupil"),
    (10.5, "iris_inner"),
    (20.0, "iris"),
    (25.0, "iris_rim"),
    (26.5, "sclera"),
    (42.0, "sclera"),
    (60.0, "sclera"),
    (80.0, "sclera"),
    (105.0, "sclera"),
)
EYE_SHRINK = 0.985  # the lids close over it without a gap or a poke

ARCH = np.radians(80)  # from the midline to the last tooth that shows
SIDE_TEETH, BACK_TEETH = np.radians(39), np.radians(51)
TOOTH_PROFILE = np.array([-0.94, -0.55, 0.0, 0.55, 0.94])  # across one tooth
TOOTH_DEPTHS = np.array([0.0, 0.85, 1.0, 0.85, 0.0])  # how far each of these stands out
TEETH_SHRINK = np.array([0.84, 0.9, 0.9])  # about their centre: no white in the mouth's corners
TEETH_BACK = 0.06  # decimetres; behind closed lips


class ToothRow(NamedTuple):
    """One row of vertices: 0 at the gum to 1 at the biting edge, and how far it stands out."""

    down: float
    out: float
    is_gum: bool = False


TOOTH_ROWS = (
    *(ToothRow(0.0, 0.0, True), ToothRow(0.3, 0.6, True), ToothRow(0.36, 0.9)),
    *(ToothRow(0.75, 1.0), ToothRow(1.0, 0.5), ToothRow(0.9, -1.6)),
)


class Jaw(NamedTuple):
    """Heights at the front and the back (decimetres), and the widths of one side's teeth."""

    gum: tuple[float, float]
    edge: tuple[float, float]
    widths: tuple[float, ...]


UPPER_JAW = Jaw((6.78, 6.84), (6.560, 6.700), (1.0, 0.8, 0.9, 0.85, 0.85, 1.1))
LOWER_JAW = Jaw((6.40, 6.55), (6.570, 6.615), (0.7, 0.75, 0.85, 0.9, 0.9, 1.2))

TONGUE_SHRINK, TONGUE_MOVE = (
    np.array([0.9, 0.65, 0.85]),
    np.array([0.0, -0.07, -0.06]),
)  # to rest behind the teeth

# The left brow seen from the front, decimetres: x, y of its centre line and its half height.
BROW = np.array(
    [
        [0.125, 7.462, 0.022],
        [0.19, 7.476, 0.027],
        [0.27, 7.490, 0.026],
        [0.34, 7.496, 0.022],
        [0.41, 7.484, 0.014],
        [0.47, 7.452, 0.004],
    ]
)
BROW_SIZE = (5, 17)
BROW_LIFT = 0.008


@dataclass(frozen=True)
class Detail:
    """A part and the material of each of its vertices."""

    part: Part
    materials: list[str]


def eye(name: str, base: Float, helper: Int) -> Detail:
    """A sphere where the helper eye is, looking along z."""
    centre, radius = sphere_of(base[helper])
    polar = np.radians([angle for angle, _ in EYE_RINGS])[:, None]
    around = np.linspace(0, 2 * np.pi, N_MERIDIANS, endpoint=False)
    rings = np.stack(
        [
            np.sin(polar) * np.cos(around),
            np.sin(polar) * np.sin(around),
            np.broadcast_to(np.cos(polar), (len(EYE_RINGS), N_MERIDIANS)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    directions = np.vstack([rings, [0, 0, 1]])
    triangles = grid_triangles(len(EYE_RINGS), N_MERIDIANS, closed=True)[:, ::-1]
    first = np.arange(N_MERIDIANS)
    cap = np.stack([np.full(N_MERIDIANS, len(rings)), first, np.roll(first, -1)], axis=1)
    points = centre + EYE_SHRINK * radius * directions
    materials = [material for _, material in EYE_RINGS for _ in range(N_MERIDIANS)]
    whole = attached(name, base, helper, points, np.vstack([triangles, cap]))
    return Detail(whole, [*materials, "pupil"])


def teeth(name: str, base: Float, helper: Int, jaw: Jaw) -> Detail:
    """A row of teeth along the arch of the helper's band, tucked in behind the lips."""
    band = base[helper]
    back, front, half_width = band[:, 2].min(), band[:, 2].max(), band[:, 0].max()
    angles, stand = _across_teeth(np.asarray(jaw.widths))
    behind = 1 - np.cos(angles)
    gum = jaw.gum[0] + (jaw.gum[1] - jaw.gum[0]) * behind
    edge = jaw.edge[0] + (jaw.edge[1] - jaw.edge[0]) * behind
    rows, materials = [], []
    for row in TOOTH_ROWS:
        reach = 0.985 + 0.03 * row.out * (0.25 + 0.75 * stand)
        down = row.down - 0.09 * (row.down > 0.9) * (1 - stand) + 0.06 * row.is_gum * stand
        x, z = half_width * reach * np.sin(angles), back + (front - back) * reach * np.cos(angles)
        rows.append(np.stack([x, gum + (edge - gum) * down, z], axis=1))
        materials += [_tooth_material(row, *at) for at in zip(stand, np.abs(angles), strict=True)]
    grid = np.concatenate(rows)
    centre = (grid.max(axis=0) + grid.min(axis=0)) / 2
    tucked = centre + TEETH_SHRINK * (grid - centre) - [0, 0, TEETH_BACK]
    triangles = grid_triangles(len(TOOTH_ROWS), len(angles))
    triangles = triangles[:, ::-1] if jaw is UPPER_JAW else triangles
    return Detail(attached(name, base, helper, tucked, triangles), materials)


def _tooth_material(row: ToothRow, stand: float, angle: float) -> str:
    """Light does not reach the back teeth; white there would flash in the corners of the mouth."""
    if angle > BACK_TEETH:
        return "mouth" if row.is_gum else "tooth_shade"
    return "gum" if row.is_gum else "teeth" if stand and angle < SIDE_TEETH else "tooth_seam"


def tongue(base: Float, quads: Int) -> Detail:
    """The helper's tongue, smaller and lower, so that the teeth show in front of it."""
    whole = copied("tongue", quads)
    at = whole.displacement(base)
    lift = (TONGUE_SHRINK - 1) * (at - at.mean(axis=0)) + TONGUE_MOVE
    deep = at[:, 2] < at[:, 2].mean()
    return Detail(
        dataclasses.replace(whole, lift=lift), ["tongue_root" if d else "tongue" for d in deep]
    )


def _across_teeth(widths: Float) -> tuple[Float, Float]:
    """Angles along the arch, right to left, and how far the tooth stands out at each."""
    seams = np.concatenate([[0], np.cumsum(widths)]) / widths.sum() * ARCH
    centres, halves = (seams[1:] + seams[:-1]) / 2, np.diff(seams) / 2
    left = (centres[:, None] + halves[:, None] * TOOTH_PROFILE).ravel()
    return np.concatenate([-left[::-1], left]), np.tile(TOOTH_DEPTHS, 2 * len(widths))


def brow(name: str, base: Float, skin: Int, side: int) -> Detail:
    """A thin strip on the skin (n, 3 triangles); `side` is 1 for the left and -1 for the right."""
    n_rows, n_columns = BROW_SIZE
    along = np.linspace(0, 1, n_columns)
    knots = np.linspace(0, 1, len(BROW))
    x, y, half = (np.polyval(np.polyfit(knots, BROW[:, k], 4), along) for k in range(3))
    half = half * np.minimum(1, 0.55 + 4 * along)  # a rounded inner end
    across = np.linspace(-1, 1, n_rows)[:, None]
    flat = np.stack([np.broadcast_to(side * x, (n_rows, n_columns)), y + across * half], axis=-1)
    corners, shares = seen_from_front(base, skin, flat.reshape(-1, 2))
    rise = np.broadcast_to(BROW_LIFT * (1 - 0.6 * np.abs(across)), (n_rows, n_columns))
    lift = np.zeros((len(corners), 3))
    lift[:, 2] = rise.ravel()
    triangles = grid_triangles(n_rows, n_columns)
    triangles = triangles if side == 1 else triangles[:, ::-1]
    return Detail(Part(name, corners, shares, triangles, lift), ["brow"] * len(corners))


def seen_from_front(base: Float, triangles: Int, points: Float) -> tuple[Int, Float]:
    """The foremost triangle at each (x, y) and the barycentric weights in it.

    Raises:
        ValueError: a point beside the mesh.
    """
    a, b, c = (base[triangles[:, k], :2] for k in range(3))
    area = _cross(b - a, c - a)
    facing = area > 1e-9
    corners, shares = [], []
    for point in points:
        doubled = (_cross(b - point, c - point), _cross(c - point, a - point))
        first, second = (
            np.divide(d, area, out=np.full(len(d), -1.0), where=facing) for d in doubled
        )
        weights = np.stack([first, second, 1 - first - second], axis=1)
        hit = np.flatnonzero((weights >= -1e-9).all(axis=1))
        if not len(hit):
            raise ValueError(f"no skin in front of {point}")
        depth = (weights[hit] * base[triangles[hit], 2]).sum(axis=1)
        nearest = hit[np.argmax(depth)]
        corners.append(triangles[nearest])
        shares.append(weights[nearest])
    return np.array(corners), np.array(shares)


def _cross(a: Float, b: Float) -> Float:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
