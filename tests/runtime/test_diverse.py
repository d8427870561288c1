"""The packaged diverse model: small, exact to its export; its faces differ and speak together."""

from itertools import combinations

import numpy as np
import pytest

import facecode
from facecode.bundle import PACKAGED, Bundle

SECONDS = 3


@pytest.fixture(scope="module")
def face():
    return facecode.load("diverse")


@pytest.fixture(scope="module")
def audio(speech):
    samples, rate = speech
    return samples[: SECONDS * rate]


@pytest.fixture(scope="module")
def faces(face, audio, speech):
    return face.animate(audio, samples=5, sample_rate=speech[1])


def region(face, name):
    return face.bundle.region(name)


def test_size_card_and_export():
    folder = PACKAGED["diverse"]
    files = [f for f in folder.rglob("*") if f.is_file()]
    assert sum(f.stat().st_size for f in files) <= 25_000_000
    assert "Limits" in (folder / "MODEL_CARD.md").read_text()
    parity = Bundle.open(folder).manifest.parity
    assert all(case.n_codes == case.n_codes_equal for case in parity.cases)


@pytest.mark.parametrize("name", ["lips", "upper_face"])
def test_every_two_faces_differ_visibly(face, faces, name):
    """A millimetre or more, root mean square over the region's most moved vertex."""
    vertices = faces.vertices[:, :, region(face, name)]
    for one, other in combinations(vertices, 2):
        apart = np.sqrt(np.square(one - other).sum(axis=-1).mean(axis=0))
        assert apart.max() > 1e-3


def test_lips_open_and_close_together(face, faces):
    upper, lower = face.manifest.lip_pair
    gaps = np.linalg.norm(faces.vertices[:, :, upper] - faces.vertices[:, :, lower], axis=-1)
    assert np.corrcoef(gaps).min() > 0.6


def test_held_lips_are_the_same_in_every_face(face, faces, audio, speech):
    held = face.animate(audio, samples=5, hold={"lips": faces[0]}, sample_rate=speech[1])
    lips = held.vertices[:, :, region(face, "lips")]
    assert np.array_equal(lips, np.broadcast_to(lips[:1], lips.shape))
    upper = held.vertices[:, :, region(face, "upper_face")]
    assert all(not np.array_equal(a, b) for a, b in combinations(upper, 2))
