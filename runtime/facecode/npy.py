"""Arrays in numpy's file format, from files that nobody vouches for.

A header is believed only as far as the bytes behind it go: nothing is allocated before. Plain
numbers and text alone; no pickle.
"""

from __future__ import annotations

import math
import tokenize
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.lib import format as npy_format

from facecode.arrays import AnyArray

PLAIN = "biufU"
"""Kinds of numpy types that are read."""


def read_npy(path: Path) -> AnyArray:
    """The array of an .npy file.

    Raises:
        ValueError: not such a file, cut short, or not of plain numbers or text.
        OSError: it cannot be opened.
    """
    with path.open("rb") as file:
        return read_array(file, path.stat().st_size)


def read_array(stream: BinaryIO, size: int) -> AnyArray:
    """The array of an open .npy file of `size` bytes, which need not seek.

    Raises:
        ValueError: as `read_npy`.
    """
    shape, fortran, dtype = _header(stream)
    if dtype.kind not in PLAIN:
        raise ValueError(f"it holds values of type {dtype}, not plain numbers")
    if any(type(n) is not int or n < 0 for n in shape):
        raise ValueError(f"its header states the shape {shape}")
    n_bytes = math.prod(shape) * dtype.itemsize
    if n_bytes > size:
        raise ValueError(f"it states {dtype} {shape} and has {size:,} bytes")
    data = bytearray(stream.read(n_bytes))
    if len(data) != n_bytes:
        raise ValueError(f"it ends after {len(data):,} of {n_bytes:,} bytes")
    if not n_bytes:
        return np.zeros(shape, dtype)
    array: AnyArray = np.frombuffer(data, dtype)
    return array.reshape(shape[::-1]).T if fortran else array.reshape(shape)


def _header(stream: BinaryIO) -> tuple[tuple[int, ...], bool, np.dtype[np.generic]]:
    """Shape, order and type. numpy's parser raises whatever Python's does."""
    try:
        version = npy_format.read_magic(stream)
        if version == (1, 0):
            return npy_format.read_array_header_1_0(stream)
        if version == (2, 0):
            return npy_format.read_array_header_2_0(stream)
    except (ValueError, SyntaxError, TypeError, tokenize.TokenError) as error:
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise ValueError(f"its header cannot be read: {reason}") from error
    raise ValueError(f"its header is of version {version[0]}.{version[1]}; expected 1.0 or 2.0")
