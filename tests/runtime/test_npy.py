"""Arrays from files that nobody vouches for."""

import io

import numpy as np
import pytest

from facecode.npy import read_array, read_npy


@pytest.mark.parametrize(
    "array",
    [
        np.arange(6, dtype=np.float32).reshape(2, 3),
        np.asfortranarray(np.arange(24.0).reshape(2, 3, 4)),
        np.zeros((0, 3), np.int64),
        np.array(2.5),
        np.array(["a", "bc"]),
        np.arange(4, dtype=">i4"),
    ],
)
def test_as_numpy_reads_it(tmp_path, array):
    np.save(tmp_path / "a.npy", array)
    found = read_npy(tmp_path / "a.npy")
    np.testing.assert_array_equal(found, array)
    assert (found.dtype, found.flags.writeable) == (array.dtype, True)
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, array, version=(2, 0))
    np.testing.assert_array_equal(
        read_array(io.BytesIO(buffer.getvalue()), len(buffer.getvalue())), array
    )


def header(text):
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "header"),
        (b"\x93NUMPY\x09\x00", "version"),
        (header("{"), "header"),
        (header("{'descr': '<f4', 'fortran_order': False, 'shape': (10**9,)}"), "header"),
        (header("{'descr': '<f4', 'fortran_order': False, 'shape': (1000000000,)}"), "states"),
        (header("{'descr': '<f4', 'fortran_order': False, 'shape': (-1,)}"), "shape"),
        (header("{'descr': '<f4', 'fortran_order': False, 'shape': (True,)}"), "shape"),
        (header("{'descr': '|O', 'fortran_order': False, 'shape': (1,)}"), "plain numbers"),
        (header("{'descr': '<c8', 'fortran_order': False, 'shape': ()}"), "plain numbers"),
        (header("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': ()}"), "plain"),
        (header("{'descr': 'zz', 'fortran_order': False, 'shape': ()}"), "header"),
        (header("{'descr': '<f4', 'fortran_order': False, 'shape': (2,)}") + b"1234", "ends"),
    ],
)
def test_headers_are_not_believed(tmp_path, data, words):
    (tmp_path / "a.npy").write_bytes(data + b"\n" * 0)
    with pytest.raises(ValueError, match=words):
        read_array(io.BytesIO(data), max(len(data), 8 if words == "ends" else 0))
