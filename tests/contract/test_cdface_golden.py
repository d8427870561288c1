"""CDFace's own golden: the committed bundle against what the torch networks said; no torch here."""

import numpy as np
import pytest
from conftest import DATA

import facecode
from facecode_spec.graphs import VERTICES

CASE = DATA / "cdface-tiny"


@pytest.fixture(scope="module")
def face():
    return facecode.load(CASE / "bundle", threads=1)


@pytest.fixture(scope="module")
def expected():
    with np.load(CASE / "expected.npz") as arrays:
        return {name: arrays[name] for name in arrays.files}


@pytest.fixture(scope="module")
def style(face, expected):
    return dict(zip(face.styles, map(float, expected["weights"]), strict=True))


def check(takes, expected, faces):
    codes = np.stack([clip.codes for clip in takes])
    offsets = np.stack([clip.offsets for clip in takes])
    np.testing.assert_array_equal(codes, expected["codes"][faces])
    np.testing.assert_allclose(offsets, expected["offsets"][faces], rtol=0, atol=VERTICES.atol)


def test_every_face(face, expected, style):
    takes = face.animate(expected["audio"], style, samples={"lips": 3, "upper_face": 2})
    check(takes, expected, slice(None))


def test_faces_are_samples_of_one_number(face, expected, style):
    check(face.animate(expected["audio"], style, samples=2), expected, [0, 3])
    check([face.animate(expected["audio"], style)], expected, [0])


def test_held_lips_vary_the_upper_face_alone(face, expected, style):
    lips = expected["codes"][4][:, :3].astype(np.int64)
    takes = face.animate(expected["audio"], style, samples={"upper_face": 2}, hold={"lips": lips})
    check(takes, expected, [4, 5])
    vertices = face.engine.parts[0].vertices
    np.testing.assert_array_equal(takes[0].offsets[:, vertices], takes[1].offsets[:, vertices])


def test_codes_alone_give_the_motion(face, expected):
    offsets = face.decode(expected["codes"].astype(np.int64))
    np.testing.assert_allclose(offsets, expected["offsets"], rtol=0, atol=VERTICES.atol)
