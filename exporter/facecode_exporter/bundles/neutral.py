"""The neutral face that goes into a bundle, with what is known of its surface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from facecode.arrays import AnyArray, Colours, Faces, Indices
from facecode.clip import Rig
from facecode.template import load_template, read_mesh


@dataclass(frozen=True)
class Neutral:
    """The neutral face that goes into a bundle; faces and colours where they are known."""

    vertices: AnyArray
    """(V, 3)"""
    faces: Faces | None = None
    """(F, 3) int32"""
    colours: Colours | None = None
    """(V, 3) uint8 RGB"""
    regions: Mapping[str, Indices] = field(default_factory=dict)
    """vertex indices (n,) int32"""
    lip_pair: tuple[int, int] | None = None
    identities: Mapping[str, AnyArray] = field(default_factory=dict)
    """further templates (V, 3)"""
    parts: Mapping[str, Indices] = field(default_factory=dict)
    """vertex indices (n,) of each part of the face, for systems of several"""
    rig: Rig | None = None
    given: bool = True


def read_neutral(template: Path | None, n_vertices: int) -> Neutral:
    """The template of a mesh file, or zeros when none is given.

    Raises:
        TemplateError
    """
    if template is None:
        return Neutral(np.zeros((n_vertices, 3), np.float32), given=False)
    vertices, faces = read_mesh(template)
    return Neutral(load_template(vertices, n_vertices), faces)
