"""Face units of the user's own, from a file: what makes a rig of a head that comes with none."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from facecode.clip import Rig
from facecode.rig_file import MOST_UNITS
from facecode_exporter.errors import UnitsError


def read_units(path: Path, n_vertices: int) -> Rig:
    """The units of an .npz with `names` (K,) and `deltas` (K, V, 3) from the template.

    Raises:
        UnitsError: no such file, or of another form or mesh.
    """
    if not path.is_file():
        raise UnitsError(f"no face units at {path}; expected an .npz of names and deltas")
    try:
        with np.load(path, allow_pickle=False) as arrays:
            names, deltas = arrays["names"], arrays["deltas"]
    except Exception as error:  # parsers of broken files raise whatever they stumble over
        raise UnitsError(
            f"{path} cannot be read: {error}; expected numpy.savez(file, names=[...], "
            "deltas=array (K, V, 3))"
        ) from error
    wanted = f"expected ({len(names) if names.ndim else 'K'}, {n_vertices:,}, 3)"
    if names.ndim != 1 or names.dtype.kind != "U":
        raise UnitsError(f"{path} has names {names.dtype} {names.shape}; expected (K,) of text")
    if deltas.shape != (len(names), n_vertices, 3) or deltas.dtype.kind not in "fiu":
        raise UnitsError(f"{path} has deltas {deltas.dtype} {deltas.shape}; {wanted} of numbers")
    if not np.isfinite(deltas).all() or not deltas.any():
        raise UnitsError(f"{path} has deltas that are not finite, or all 0; {wanted}")
    listed = tuple(map(str, names))
    if not 0 < len(listed) <= MOST_UNITS or len(set(listed)) < len(listed) or "" in listed:
        raise UnitsError(f"{path} names {len(listed)} units; expected 1 to {MOST_UNITS}, unlike")
    return Rig(listed, np.ascontiguousarray(deltas, np.float32))
