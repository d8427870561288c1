"""The demo head: a template, its 52 face units, identities, colours and regions.

Comes in: `head.npz`. Goes out: arrays in metres, y up, z forward, x to the head's left, the origin
between the ears. Knows nothing of where the head came from (`head_build.py` does) or of speech.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Faces, Float32, Offsets, Template
from facecode_exporter.errors import CorpusError
from facecode_exporter.head.face_units import FACE_UNITS

PACKAGED = Path(__file__).with_name("head.npz")
REGIONS = ("lips", "upper_face")
LIP_PAIR = (468, 494)
"""Inner edge of the upper and lower lip on the midline: of all pairs of lip vertices near it, the
one whose plain distance is smallest in closures compared with its 95th percentile (11 %). The
head's own pair, made for the vertical part alone, slides apart when lips press."""


@dataclass(frozen=True)
class Head:
    """One topology, several faces."""

    faces: Faces
    identities: Mapping[str, Template]
    """name -> (V, 3); the first is the template of the corpus"""
    unit_offsets: Float32
    """(52, V, 3) displacement of each face unit at weight 1, in the order of FACE_UNITS"""
    materials: Mapping[str, NDArray[np.uint8]]
    """material -> (V,) share of 255; the shares of a vertex sum to 255"""
    palettes: NDArray[np.uint8]
    """(n_identities, n_materials, 3) sRGB"""
    regions: Mapping[str, NDArray[np.int64]]
    """vertex indices: `lips`, and `upper_face` = brows, eyes, forehead, upper cheeks"""
    lip_pair: tuple[int, int]
    """upper and lower inner lip on the midline; their (vertical) distance is the mouth opening"""

    @property
    def template(self) -> Template:
        """(V, 3) the neutral face of the corpus."""
        return next(iter(self.identities.values()))

    def colours(self, identity: str | None = None) -> NDArray[np.uint8]:
        """(V, 3) sRGB of one identity; the template's by default."""
        names = list(self.identities)
        palette = self.palettes[names.index(identity) if identity else 0].astype(np.float32)
        shares = np.stack(list(self.materials.values()), axis=1) / np.float32(255)
        return np.asarray(np.rint(shares @ palette), np.uint8)

    def offsets(self, weights: NDArray[Any]) -> Offsets:
        """(T, V, 3) float32 metres for (T, 52) weights."""
        n_frames, n_units = weights.shape
        if n_units != len(FACE_UNITS):
            raise CorpusError(
                f"weights have {n_units} columns; expected the {len(FACE_UNITS)} ARKit face units"
            )
        flat = self.unit_offsets.reshape(n_units, -1)
        return (weights.astype(np.float32) @ flat).reshape(n_frames, -1, 3)

    def opening(self, weights: NDArray[Any]) -> Float32:
        """(T,) metres between the inner lips at the midline, for (T, 52) weights.

        The vertical part of the distance of `lip_pair`: lips that press slide along each other,
        which lengthens the distance of two vertices though the mouth is shut. Negative where they
        overlap. Does not expand the head.
        """
        upper, lower = self.lip_pair
        gap = self.template[upper, 1] - self.template[lower, 1]
        return np.asarray(gap + weights.astype(np.float32) @ self._lip_gap)

    @cached_property
    def _lip_gap(self) -> Float32:
        upper, lower = self.lip_pair
        return self.unit_offsets[:, upper, 1] - self.unit_offsets[:, lower, 1]


def save_head(head: Head, path: Path) -> None:
    """Write `head.npz`. Only what face units move is stored, as float16: at worst 15 um off."""
    unit, vertex = np.nonzero(np.abs(head.unit_offsets).max(axis=2) > 0)
    relative = [face - head.template for face in head.identities.values()]
    regions: dict[str, Any] = {
        f"region_{name}": head.regions[name].astype(np.uint16) for name in REGIONS
    }
    np.savez_compressed(
        path,
        faces=head.faces.astype(np.uint16),
        template=head.template,
        identity_names=np.array(list(head.identities)),
        identity_offsets=np.stack(relative).astype(np.float16),
        unit_names=np.array(FACE_UNITS),
        unit_starts=np.searchsorted(unit, np.arange(len(FACE_UNITS) + 1)),
        unit_vertices=vertex.astype(np.uint16),
        unit_offsets=head.unit_offsets[unit, vertex].astype(np.float16),
        material_names=np.array(list(head.materials)),
        material_shares=np.stack(list(head.materials.values())),
        palettes=head.palettes,
        lip_pair=np.array(head.lip_pair),
        **regions,
    )


def load_head(path: Path = PACKAGED) -> Head:
    """Read `head.npz`; the packaged one by default.

    Raises:
        CorpusError: unreadable, or with other face units.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except (OSError, ValueError) as error:
        raise CorpusError(f"{path}: not a demo head that can be read: {error}") from error
    if tuple(arrays["unit_names"].tolist()) != FACE_UNITS:
        raise CorpusError(f"{path}: face units are not the 52 of ARKit in this release's order")
    return _from_arrays(arrays)


def _from_arrays(arrays: Mapping[str, NDArray[Any]]) -> Head:
    template: Template = arrays["template"]
    unit_offsets = np.zeros((len(FACE_UNITS), *template.shape), np.float32)
    n_moved = np.diff(arrays["unit_starts"])
    unit = np.repeat(np.arange(len(FACE_UNITS)), n_moved)
    unit_offsets[unit, arrays["unit_vertices"]] = arrays["unit_offsets"]
    names = arrays["identity_names"].tolist()
    upper, lower = arrays["lip_pair"].tolist()
    return Head(
        faces=arrays["faces"].astype(np.int32),
        identities=dict(zip(names, template + arrays["identity_offsets"], strict=True)),
        unit_offsets=unit_offsets,
        materials=dict(
            zip(arrays["material_names"].tolist(), arrays["material_shares"], strict=True)
        ),
        palettes=arrays["palettes"],
        regions={name: arrays[f"region_{name}"].astype(np.int64) for name in REGIONS},
        lip_pair=(upper, lower),
    )
