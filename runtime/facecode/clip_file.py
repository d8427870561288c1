"""A clip out of an .npz that facecode wrote, to be held, converted or looked at.

Trusts nobody: sizes are known from the headers before anything is unpacked.
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO, cast

import numpy as np

from facecode.animation import Animation
from facecode.arrays import AnyArray
from facecode.clip import Rig
from facecode.errors import ClipFileError, ClipNotFoundError
from facecode.npy import read_array

LARGEST_SHARE = 64
"""How many times its size a file may unpack to; rigs take a twentieth of theirs."""
SMALL = 1 << 26
"""Bytes that any file may unpack to."""
KINDS = {"vertices": "f", "codes": "iu", "fps": "f", "parts": "U", "codes_per_part": "iu",
    "template": "f", "faces": "iu", "colours": "u", "unit": "U", "mode": "U",
    "metres_per_unit": "f", "up_axis": "U", "styles": "U", "style_weights": "f", "lip_pair": "iu",
    "audio": "f", "sample_rate": "iu", "rig_names": "U", "rig_deltas": "f"}  # fmt: skip
"""Kinds of numpy types of each array; other arrays are not looked at."""


def read_clip(path: str | os.PathLike[str], index: int = 0) -> Animation:
    """The clip that `Animation.save("talk.npz")` wrote; it can be saved in every format.

    Args:
        path: the file.
        index: of the face, where the file holds several.

    Raises:
        ClipNotFoundError: no such file.
        ClipFileError: not such a file, or no face of that number.
    """
    arrays = read_arrays(Path(path))
    name = os.fspath(path)
    missing = [need for need in ("vertices", "codes", "fps", "template") if need not in arrays]
    if missing:
        raise ClipFileError(
            f"{name} has no {missing[0]}; expected an .npz of this release, whose `animate` keeps "
            "what is needed"
        )
    vertices, codes = arrays["vertices"], arrays["codes"]
    if vertices.ndim == 4:  # several faces
        if not 0 <= index < len(vertices) or len(codes) != len(vertices):
            raise ClipFileError(f"{name} holds {len(vertices)} faces; there is no number {index}")
        vertices, codes = vertices[index], codes[index]
    elif index:
        raise ClipFileError(f"{name} holds one face; there is no number {index}")
    _check(name, arrays, vertices, codes)
    return _clip(arrays, vertices, codes)


def read_arrays(path: Path) -> dict[str, AnyArray]:
    """The arrays of KINDS that the file holds.

    Raises:
        ClipNotFoundError, ClipFileError.
    """
    if not path.is_file():
        raise ClipNotFoundError(f"{path} {'is a folder' if path.is_dir() else 'does not exist'}")
    try:
        with zipfile.ZipFile(path) as archive:
            members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
            most = max(LARGEST_SHARE * path.stat().st_size, SMALL)
            if sum(info.file_size for info in members.values()) > most:
                raise ClipFileError(f"{path} unpacks to more than {most:,} bytes")
            known = {name: info for name, info in members.items() if name in KINDS}
            return {name: _read(archive, info, name) for name, info in known.items()}
    except (OSError, ValueError, KeyError, EOFError, SyntaxError, RuntimeError) as error:
        if isinstance(error, ClipFileError):
            raise
        raise ClipFileError(f"{path} is no .npz of facecode ({error})") from None
    except (zipfile.BadZipFile, NotImplementedError, MemoryError, zipfile.LargeZipFile) as error:
        raise ClipFileError(f"{path} is no .npz of facecode ({error})") from None


def _read(archive: zipfile.ZipFile, info: zipfile.ZipInfo, name: str) -> AnyArray:
    with archive.open(info) as member:
        array = read_array(cast(BinaryIO, member), info.file_size)
    if array.dtype.kind not in KINDS[name]:
        raise ClipFileError(f"{name} is {array.dtype} {array.shape}")
    return array


def _check(name: str, arrays: Mapping[str, AnyArray], vertices: AnyArray, codes: AnyArray) -> None:
    """Refuse arrays that do not belong together."""
    n = arrays["template"].shape[0] if arrays["template"].ndim == 2 else 0
    faces, rig = arrays.get("faces"), arrays.get("rig_deltas")
    names, pair = arrays.get("rig_names"), arrays.get("lip_pair")
    fits = [
        vertices.ndim == 3 and vertices.shape[1:] == (n, 3) == arrays["template"].shape,
        codes.ndim == 2 and len(codes) == len(vertices),
        arrays["fps"].shape == () and 0 < arrays["fps"] < np.inf,
        np.isfinite(arrays["template"]).all() and np.isfinite(vertices).all(),
        faces is None or (faces.ndim == 2 and faces.shape[1] == 3 and _below(faces, n)),
        "colours" not in arrays or arrays["colours"].shape == (n, 3),
        "audio" not in arrays or (arrays["audio"].ndim == 1 and "sample_rate" in arrays),
        (rig is None) == (names is None),
        rig is None or (rig.shape[1:] == (n, 3) and names is not None and len(rig) == len(names)),
        pair is None or (pair.shape == (2,) and _below(pair, n)),
        len(arrays.get("styles", ())) == len(arrays.get("style_weights", ())),
        sum(arrays.get("codes_per_part", [codes.shape[-1]])) == codes.shape[-1],
        len(arrays.get("parts", ())) == len(arrays.get("codes_per_part", ())),
    ]
    if not all(fits):
        raise ClipFileError(f"the arrays of {name} do not belong together; animate it again")


def _below(indices: AnyArray, n: int) -> bool:
    return not indices.size or (int(indices.min()) >= 0 and int(indices.max()) < n)


def _clip(arrays: Mapping[str, AnyArray], vertices: AnyArray, codes: AnyArray) -> Animation:
    def each(names: str, values: str) -> dict[str, float]:
        pairs = zip(arrays.get(names, ()), arrays.get(values, ()), strict=True)
        return {str(name): value.item() for name, value in pairs}

    def scalar(name: str) -> float | str | None:
        return arrays[name].item() if name in arrays else None

    template = np.asarray(arrays["template"], np.float32)
    rig = None
    if "rig_deltas" in arrays:
        names = tuple(map(str, arrays["rig_names"]))
        rig = Rig(names, np.asarray(arrays["rig_deltas"], np.float32))
    parts = each("parts", "codes_per_part") or {"face": codes.shape[1]}
    pair = arrays.get("lip_pair")
    metres, rate, axis = scalar("metres_per_unit"), scalar("sample_rate"), scalar("up_axis")
    return Animation(
        offsets=np.asarray(vertices, np.float32) - template,
        codes=np.asarray(codes, np.int64),
        fps=float(arrays["fps"]),
        template=template,
        faces=None if "faces" not in arrays else arrays["faces"].astype(np.int32),
        colours=None if "colours" not in arrays else arrays["colours"].astype(np.uint8),
        audio=None if "audio" not in arrays else arrays["audio"].astype(np.float32),
        sample_rate=None if rate is None else int(rate),
        parts={name: int(n) for name, n in parts.items()},
        unit=str(scalar("unit") or ""),
        metres_per_unit=None if metres is None else float(metres),
        up_axis=None if axis is None else str(axis),
        styles=each("styles", "style_weights"),
        mode=str(scalar("mode") or ""),
        lip_pair=None if pair is None else (int(pair[0]), int(pair[1])),
        rig=rig,
    )
