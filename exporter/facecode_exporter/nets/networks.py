"""The network of every family of systems."""

from __future__ import annotations

from typing import TypeAlias

from facecode_exporter.nets.cdface import CDFace
from facecode_exporter.nets.codetalker import CodeTalker
from facecode_exporter.nets.faceformer import FaceFormer
from facecode_spec.schema import SystemSpec

Network: TypeAlias = CodeTalker | CDFace | FaceFormer
"""A trained system: `system`, `audio_encoder`, `part_nets`."""

NETWORKS: dict[str, type[CodeTalker] | type[CDFace] | type[FaceFormer]] = {
    "codetalker": CodeTalker,
    "cdface": CDFace,
    "faceformer": FaceFormer,
}
"""By the family that a spec gives."""


def network_of(system: SystemSpec) -> Network:
    """The network of `system`, with fresh weights."""
    return NETWORKS[system.family](system)
