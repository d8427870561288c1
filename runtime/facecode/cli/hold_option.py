"""The option `--hold`: codes of one part of the face out of a file that facecode wrote."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from facecode.arrays import Codes
from facecode.clip_file import read_arrays
from facecode.errors import CodesError, FacecodeError


def parse_hold(text: str) -> tuple[str, Codes]:
    """`PART=FILE.npz`, or `PART=FILE.npz#K` for the K-th of several faces, to part and codes.

    Raises:
        CodesError: not of this form, or a file without such codes.
    """
    part, equals, place = text.partition("=")
    name, hash_sign, number = place.rpartition("#")
    if not hash_sign or Path(place).is_file():  # a name may hold the sign itself
        name, number = place, ""
    if not equals or not part or not name or not (number or "0").isdigit():
        raise CodesError(f"got {text!r} to hold; expected PART=FILE.npz or PART=FILE.npz#K")
    return part, read_codes(Path(name), part, int(number or 0))


def read_codes(path: Path, part: str, index: int = 0) -> Codes:
    """Codes (T, H) of `part`, of the face number `index` where the file holds several.

    Raises:
        CodesError
    """
    try:
        arrays = read_arrays(path)
        codes = arrays["codes"]
    except (FacecodeError, KeyError) as error:
        raise CodesError(f"{path} holds no codes ({error}); expected an .npz of facecode") from None
    faces = codes[None] if codes.ndim == 2 else codes
    if faces.ndim != 3 or not index < len(faces):
        raise CodesError(f"{path} holds {len(faces)} faces; there is no number {index}")
    if "parts" not in arrays:
        return np.asarray(faces[index])
    names = [str(name) for name in arrays["parts"]]
    if part not in names:
        raise CodesError(f"{path} holds {', '.join(names)}; got {part!r}")
    edges = np.cumsum([0, *arrays["codes_per_part"]])
    column = names.index(part)
    return np.asarray(faces[index][:, edges[column] : edges[column + 1]])
