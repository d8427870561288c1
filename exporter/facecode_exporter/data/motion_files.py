"""Vertices over time from a file: .npy as data sets store them, .npz as facecode writes them."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path

import numpy as np

from facecode.arrays import AnyArray
from facecode_exporter.errors import EvaluationError

SUFFIXES = (".npy", ".npz")
_UNREADABLE = (OSError, ValueError, EOFError, KeyError, TypeError, zipfile.BadZipFile, zlib.error)


def read_motion(path: Path, n_vertices: int, fps: float | None = None) -> AnyArray:
    """Vertices (T, V, 3), in the float type of the file.

    Args:
        path: .npy of (T, 3V) or (T, V, 3), a leading 1 allowed; or .npz with `vertices` and `fps`.
        n_vertices: V of the mesh that the motion belongs to.
        fps: the rate that an .npz must have; a .npy does not say.

    Raises:
        EvaluationError: unreadable, of another shape or rate, or with values that are not finite.
    """
    try:
        vertices, rate = _read(path)
    except _UNREADABLE as error:
        raise EvaluationError(
            f"{path} cannot be read: {error}; expected .npy (T, 3V), or .npz of facecode"
        ) from error
    if None not in (fps, rate) and fps != rate:
        raise EvaluationError(f"{path} moves at {rate:g} fps; expected {fps:g}")
    return _as_motion(vertices, n_vertices, path)


def _read(path: Path) -> tuple[AnyArray, float | None]:
    content = np.load(path, allow_pickle=False)
    if isinstance(content, np.ndarray):
        return content, None
    with content as arrays:
        return arrays["vertices"], float(arrays["fps"])


def _as_motion(array: AnyArray, n_vertices: int, path: Path) -> AnyArray:
    allowed = ((3 * n_vertices,), (n_vertices, 3))
    frames = array
    if array.ndim > 2 and len(array) == 1 and array.shape[1:] not in allowed:
        frames = array[0]
    if frames.shape[1:] not in allowed or not np.issubdtype(array.dtype, np.floating):
        raise EvaluationError(
            f"{path} is {array.dtype} {array.shape}; expected floats (T, {3 * n_vertices}) or "
            f"(T, {n_vertices}, 3) for a mesh of {n_vertices:,} vertices"
        )
    if not np.isfinite(frames).all():
        raise EvaluationError(f"{path} holds values that are NaN or infinite; leave it out")
    return frames.reshape(len(frames), n_vertices, 3)
