"""Motion in a glTF document: an animation with linear keys at the clip's rate.

Comes in: values of nodes for each frame. Goes out: an animation, its samplers and accessors.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias

import numpy as np

from facecode.arrays import Float32
from facecode.writers.gltf.document import Document

Channel: TypeAlias = tuple[int, str, Float32]
"""(node, path: `weights` or `translation`, values: (T, n) weights or (T, 3) metres)"""


def add_animation(document: Document, name: str, fps: float, channels: Iterable[Channel]) -> int:
    """The index of a new animation; frame i is at i / fps seconds. Equal samplers are shared."""
    samplers: list[dict[str, int | str]] = []
    targets = []
    for node, path, values in channels:
        keys = values.ravel() if path == "weights" else values
        times = np.asarray(np.arange(len(values)) / fps, np.float32)
        sampler: dict[str, int | str] = {
            "input": document.accessor(times, bounds=True),
            "interpolation": "LINEAR",
            "output": document.accessor(keys),
        }
        if sampler not in samplers:
            samplers.append(sampler)
        index = samplers.index(sampler)
        targets.append({"sampler": index, "target": {"node": node, "path": path}})
    return document.add("animations", name=name, channels=targets, samplers=samplers)
