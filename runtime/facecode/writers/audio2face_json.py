"""Audio2Face's .json: names of face units, a matrix of weights, the rate.

Comes in: a clip with units of any names, whole or block by block. Goes out: one JSON object, one
line a frame. Weights have six decimals.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import BinaryIO

from facecode.clip import Clip
from facecode.writers.format import Format, of_blocks

DECIMALS = 6


def write_blocks_json(face: Clip, n_frames: int, blocks: Iterable[Clip], file: BinaryIO) -> None:
    """Write the object to an open binary file, which need not seek.

    Raises:
        NoRigError: the face units are not known.
    """
    head = {
        "exportFps": face.fps,
        "trackPath": "",
        "numPoses": len(face.weight_names),
        "numFrames": n_frames,
        "facsNames": list(face.weight_names),
    }
    file.write(json.dumps(head)[:-1].encode() + b', "weightMat": [')
    separator = "\n"
    for block in blocks:
        for row in block.weights.round(DECIMALS).tolist():
            values = ", ".join(repr(round(value, DECIMALS)) for value in row)
            file.write(f"{separator}[{values}]".encode())
            separator = ",\n"
    file.write(b"\n]}\n")


JSON = Format(
    ".json",
    of_blocks(write_blocks_json),
    write_blocks=write_blocks_json,
    needs_rig=True,
    needs_vertices=False,
)
