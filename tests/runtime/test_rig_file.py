"""The rig of a bundle: the same bytes every time, and nothing unpacked that was not expected."""

import io
import zipfile

import numpy as np
import pytest

from facecode.bundle import PACKAGED, Bundle
from facecode.clip import Rig
from facecode.errors import ManifestError
from facecode.rig_file import read_rig, write_rig

NAMES = ("jawOpen", "mouthClose")


def rig(n_vertices=5):
    deltas = np.random.default_rng(0).standard_normal((2, n_vertices, 3)).astype(np.float32)
    return Rig(NAMES, deltas)


def saved(path, value):
    with path.open("wb") as file:
        write_rig(value, file)
    return path


def test_round_trip_and_the_same_bytes(tmp_path):
    one, two = (saved(tmp_path / name, rig()) for name in ("a.npz", "b.npz"))
    assert one.read_bytes() == two.read_bytes()
    found = read_rig(one, NAMES, 5)
    assert found.names == NAMES
    np.testing.assert_array_equal(found.deltas, rig().deltas)


@pytest.mark.parametrize("name", PACKAGED)
def test_packaged_bundles_carry_the_units_of_their_head(name):
    bundle = Bundle.open(PACKAGED[name])
    assert bundle.rig.deltas.shape == (52, bundle.manifest.n_vertices, 3)
    assert {"jawOpen", "mouthClose", "eyeBlinkLeft", "tongueOut"} <= set(bundle.rig.names)


def test_rigs_that_do_not_fit(tmp_path):
    file = saved(tmp_path / "rig.npz", rig())
    for names, n_vertices, words in (
        (NAMES, 6, "expected finite float32"),
        (NAMES[::-1], 5, "other names"),
        ((), 5, "expected 1 to"),
        (("a", "a"), 5, "expected 1 to"),
    ):
        with pytest.raises(ManifestError, match=words):
            read_rig(file, names, n_vertices)
    nan = rig()
    nan.deltas[0, 0, 0] = np.nan
    with pytest.raises(ManifestError, match="finite"):
        read_rig(saved(tmp_path / "nan.npz", nan), NAMES, 5)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 not a zip", b"\x93NUMPY"])
def test_files_that_are_no_rig(tmp_path, content):
    (tmp_path / "rig.npz").write_bytes(content)
    with pytest.raises(ManifestError, match=r"rig\.npz"):
        read_rig(tmp_path / "rig.npz", NAMES, 5)


def test_what_unpacks_to_more_is_not_unpacked(tmp_path):
    buffer = io.BytesIO()
    np.save(buffer, np.zeros((2, 1_000_000, 3), np.float32))
    with zipfile.ZipFile(tmp_path / "rig.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("deltas.npy", buffer.getvalue())
    with pytest.raises(ManifestError, match="unpacks to more"):
        read_rig(tmp_path / "rig.npz", NAMES, 5)
