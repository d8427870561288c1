"""A VRM animation (.vrma): weights as expressions of an avatar (VRMC_vrm_animation 1.0).

Comes in: a clip with units. Goes out: a .glb without a mesh whose nodes carry a weight each, as
the x of their translation. `VRMA` writes every unit as a custom expression in PascalCase, as
avatars for ARKit tracking ("Perfect Sync") name them; `PRESETS` the seven presets that any VRM
has. Never both: an avatar that has both would move twice.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import BinaryIO

import numpy as np

from facecode.arrays import Float32
from facecode.clip import Clip
from facecode.writers.arkit import NAMES, columns, in_order, pascal
from facecode.writers.format import Format, WriteBlocks, of_blocks
from facecode.writers.gltf.animation import add_animation
from facecode.writers.gltf.document import Document

EXTENSION = "VRMC_vrm_animation"


def write_blocks_vrma(face: Clip, n_frames: int, blocks: Iterable[Clip], file: BinaryIO) -> None:
    """Write every unit of the rig as a custom expression; the weights are gathered first.

    Raises:
        NoRigError: the face units are not known.
    """
    del n_frames
    none = np.zeros((0, len(face.weight_names)), np.float32)
    weights = np.concatenate([none, *(block.weights for block in blocks)])
    by_name = {pascal(name): weights[:, i] for i, name in enumerate(face.weight_names)}
    _write(face.fps, "custom", by_name, file)


def write_blocks_presets(face: Clip, n_frames: int, blocks: Iterable[Clip], file: BinaryIO) -> None:
    """Write the presets aa, ih, ou, ee, oh, blinkLeft, blinkRight; the weights are gathered first.

    Raises:
        NoRigError: the face units are not known.
        UnitNamesError: the rig has no unit of ARKit's.
    """
    del n_frames
    found = columns(face.weight_names, ".vrma")
    none = np.zeros((0, len(NAMES)), np.float32)
    weights = np.concatenate([none, *(in_order(block.weights, found) for block in blocks)])
    _write(face.fps, "preset", presets(weights), file)


def presets(weights: Float32) -> Mapping[str, Float32]:
    """The seven presets (T,) of ARKit weights (T, 52) in the order of `arkit.NAMES`.

    The mouth's opening goes to the vowels by its shape: rounded lips to oh and ou, wide ones to ee
    and ih, the rest to aa.
    """
    at = {name: weights[:, place] for place, name in enumerate(NAMES)}
    opening = at["jawOpen"]
    rounded = np.maximum(at["mouthPucker"], at["mouthFunnel"])
    wide = np.maximum(
        at["mouthSmileLeft"] + at["mouthSmileRight"],
        at["mouthStretchLeft"] + at["mouthStretchRight"],
    ) / np.float32(2)
    wide = np.minimum(wide, 1 - rounded)
    return {
        "aa": opening * (1 - rounded - wide),
        "ih": wide * (1 - opening),
        "ou": rounded * (1 - opening),
        "ee": wide * opening,
        "oh": rounded * opening,
        "blinkLeft": at["eyeBlinkLeft"],
        "blinkRight": at["eyeBlinkRight"],
    }


def _write(fps: float, kind: str, by_name: Mapping[str, Float32], file: BinaryIO) -> None:
    from importlib.metadata import version

    document = Document(
        {"asset": {"version": "2.0", "generator": f"facecode {version('facecode')}"}, "scene": 0}
    )
    nodes = {name: document.add("nodes", name=name) for name in by_name}
    document.add("scenes", nodes=list(nodes.values()))
    channels = []
    for name, weights in by_name.items():
        translation = np.zeros((len(weights), 3), np.float32)
        translation[:, 0] = weights
        channels.append((nodes[name], "translation", translation))
    if any(len(weights) for weights in by_name.values()):  # an animation of no key is not valid
        add_animation(document, "facecode", fps, channels)
    expressions = {kind: {name: {"node": node} for name, node in nodes.items()}}
    document.tree["extensionsUsed"] = [EXTENSION]
    document.tree["extensions"] = {EXTENSION: {"specVersion": "1.0", "expressions": expressions}}
    document.write(file)


def _format(write_blocks: WriteBlocks) -> Format:
    return Format(
        ".vrma", of_blocks(write_blocks), None, write_blocks, needs_rig=True, needs_vertices=False
    )


VRMA = _format(write_blocks_vrma)
PRESETS = _format(write_blocks_presets)
KINDS = {"custom": VRMA, "presets": PRESETS}
"""By what a command line calls them."""
