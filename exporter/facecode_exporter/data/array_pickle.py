"""Read `templates.pkl`: a pickle of {name: array}, without running anything that it asks for.

The data sets store their neutral faces as a Python-2 pickle. A pickle is a program; this reader
knows four of numpy's constructors, stands in for them with plain values of its own, and refuses the
rest. numpy itself sees only the raw bytes, with a shape and a floating type that fit them.
"""

from __future__ import annotations

import codecs
import math
import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np

from facecode.arrays import AnyArray
from facecode_exporter.errors import DataSetError

_FLOAT = re.compile(r"[<>=|]?(f[248])")


class _DType:
    """Stands for numpy.dtype: floats only."""

    def __init__(self, code: str, *_: object) -> None:
        match = _FLOAT.fullmatch(code)
        if match is None:
            raise pickle.UnpicklingError(f"an array of type {code!r}; expected floats")
        self.code, self.order = match[1], code[0] if code[0] in "<>" else "<"

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        if any(part is not None for part in state[2:5]):
            raise pickle.UnpicklingError("an array with fields; expected plain floats")
        self.order = ">" if state[1] == ">" else "<"

    def numpy(self) -> np.dtype[Any]:
        return np.dtype(self.order + self.code)


class _Array:
    """Stands for numpy.ndarray until its bytes are known."""

    shape: tuple[int, ...] = (0,)
    dtype = _DType("f8")
    order, raw = "C", b""

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        _, self.shape, self.dtype, fortran, raw = state
        self.order = "F" if fortran else "C"
        self.raw = raw.encode("latin1") if isinstance(raw, str) else bytes(raw)

    def numpy(self) -> AnyArray:
        dtype = self.dtype.numpy()
        if len(self.raw) != math.prod(self.shape) * dtype.itemsize:
            raise pickle.UnpicklingError(f"{len(self.raw)} bytes for shape {self.shape}")
        return np.frombuffer(self.raw, dtype).reshape(self.shape, order=self.order)  # type: ignore[call-overload,no-any-return]


def _reconstruct(*_: object) -> _Array:
    return _Array()


def _from_buffer(raw: bytes, dtype: _DType, shape: tuple[int, ...], order: str) -> _Array:
    array = _Array()
    array.__setstate__((1, shape, dtype, order == "F", raw))
    return array


def _encode(text: str, encoding: str = "latin1") -> bytes:
    if codecs.lookup(encoding).name != "iso8859-1":
        raise pickle.UnpicklingError(f"text as {encoding}; expected latin1")
    return text.encode("latin1")


_STAND_INS = {
    ("multiarray", "_reconstruct"): _reconstruct,
    ("numeric", "_frombuffer"): _from_buffer,
    ("numpy", "ndarray"): _Array,
    ("numpy", "dtype"): _DType,
    ("_codecs", "encode"): _encode,
}


class _ArraysOnly(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:  # noqa: ANN401
        known = re.sub(r"^numpy\._?core\.(multiarray|numeric)$", r"\1", module)
        try:
            return _STAND_INS[known, name]
        except KeyError:
            raise pickle.UnpicklingError(
                f"it asks for {module}.{name}, which is no array"
            ) from None


def read_array_pickle(path: Path) -> dict[str, AnyArray]:
    """{name: array of floats} from a pickle of Python 2 or 3.

    Raises:
        DataSetError: missing, no pickle, or one that holds anything but named arrays of floats.
    """
    try:
        with path.open("rb") as file:
            content = _ArraysOnly(file, encoding="latin1").load()
        return {str(name): array.numpy() for name, array in content.items()}
    except OSError as error:
        raise DataSetError(f"{path} cannot be read: {error.strerror or error}") from error
    except Exception as error:  # a broken pickle raises whatever it stumbles over
        raise DataSetError(
            f"{path}: {error}; expected a pickle of {{subject: (V, 3) array}} and nothing else"
        ) from error
