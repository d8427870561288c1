"""The packaged head: a sound mesh, shut lips, face units that do what they are called."""

import numpy as np
import pytest

from facecode_exporter.errors import CorpusError
from facecode_exporter.head.details import seen_from_front
from facecode_exporter.head.face_units import FACE_UNITS, UNIT, unit_weights
from facecode_exporter.head.head import PACKAGED, Head, load_head, save_head


@pytest.fixture(scope="module")
def head() -> Head:
    return load_head()


def moved(head, **weights):
    return head.offsets(unit_weights(**weights)[None])[0]


def material(head, name):
    return np.flatnonzero(head.materials[name] > 127)


def test_there_are_52_distinct_units():
    assert len(FACE_UNITS) == len(set(FACE_UNITS)) == 52
    assert [name for name in FACE_UNITS if UNIT[name] != FACE_UNITS.index(name)] == []


def test_a_name_without_its_side_sets_both():
    row = unit_weights(mouthSmile=0.5, jawOpen=0.2)
    assert row[[UNIT["mouthSmileLeft"], UNIT["mouthSmileRight"]]].tolist() == [0.5, 0.5]
    assert np.count_nonzero(row) == 3
    with pytest.raises(KeyError):
        unit_weights(mouthWide=1)


def test_every_face_is_a_triangle_of_vertices_that_exist(head):
    n_vertices = len(head.template)
    assert head.faces.min() == 0
    assert head.faces.max() == n_vertices - 1
    assert len(np.unique(head.faces)) == n_vertices
    a, b, c = head.faces.T
    assert ((a != b) & (b != c) & (c != a)).all()


def test_no_edge_has_more_than_two_triangles(head):
    edges = np.sort(head.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, uses = np.unique(edges, axis=0, return_counts=True)
    assert uses.max() == 2


def test_the_neck_ends_in_one_loop(head):
    edges = head.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    _, first, uses = np.unique(
        np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True
    )
    border = edges[first[uses == 1]]
    lowest = head.template[border.ravel(), 1].min()
    neck = border[(head.template[border, 1] < lowest + 0.06).all(axis=1)]
    _, degree = np.unique(neck, return_counts=True)
    assert (len(neck), set(degree.tolist())) == (42, {2})


@pytest.mark.parametrize("name", list(load_head().identities))
def test_every_identity_is_a_head_in_metres(head, name):
    face = head.identities[name]
    assert face.shape == head.template.shape
    assert face.dtype == np.float32
    assert np.isfinite(face).all()
    assert 0.2 < np.ptp(face[:, 1]) < 0.36


def test_the_head_is_symmetric_but_for_what_its_makers_left(head):
    mirrored = head.template * [-1, 1, 1]
    apart = np.linalg.norm(mirrored[::7, None] - head.template[None], axis=2).min(axis=1)
    assert np.median(apart) < 0.2e-3
    assert apart.max() < 6e-3


@pytest.mark.parametrize("name", list(load_head().identities))
def test_lips_touch_at_rest_and_hide_the_teeth(head, name):
    face = head.identities[name]
    upper, lower = head.lip_pair
    assert abs(face[upper, 1] - face[lower, 1]) < 1e-3
    teeth = np.concatenate([material(head, n) for n in ("teeth", "tooth_seam", "tooth_shade")])
    skin = head.faces[~np.isin(head.faces, teeth).any(axis=1)]
    corners, shares = seen_from_front(face, skin, face[teeth, :2])
    in_front = (face[corners, 2] * shares).sum(axis=1)
    assert (in_front > face[teeth, 2] + 1e-3).all()


def test_the_jaw_opens_the_mouth_and_mouth_close_shuts_it_again(head):
    def opening(**weights):
        return float(head.opening(unit_weights(**weights)[None])[0])

    rest = opening()
    assert opening(jawOpen=0.3) > rest + 8e-3
    assert opening(jawOpen=0.6) > opening(jawOpen=0.3)
    assert abs(opening(jawOpen=0.3, mouthClose=0.3) - rest) < 0.5e-3


def test_opening_is_that_of_the_expanded_head(head):
    weights = np.random.default_rng(0).uniform(0, 0.5, (4, 52)).astype(np.float16)
    upper, lower = head.lip_pair
    vertices = head.template + head.offsets(weights)
    expected = vertices[:, upper, 1] - vertices[:, lower, 1]
    np.testing.assert_allclose(head.opening(weights), expected, atol=1e-7)  # float32 sums


def test_the_lip_pair_is_on_the_midline_and_among_the_lips(head):
    upper, lower = head.lip_pair
    assert abs(head.template[[upper, lower], 0]).max() < 1e-4
    assert {upper, lower} <= set(head.regions["lips"].tolist())


def test_speech_moves_the_lips_and_brows_move_the_upper_face(head):
    lips, upper_face = head.regions["lips"], head.regions["upper_face"]
    assert not set(lips.tolist()) & set(upper_face.tolist())
    speech = np.abs(moved(head, jawOpen=0.5, mouthPucker=0.5)).max(axis=1)
    brows = np.abs(moved(head, browInnerUp=1, eyeBlink=1)).max(axis=1)
    assert speech[lips].mean() > 20 * speech[upper_face].mean()
    assert brows[upper_face].mean() > 100 * brows[lips].mean()


def test_eyes_turn_without_changing_size(head):
    iris = material(head, "iris")
    left = iris[head.template[iris, 0] > 0]
    turned = head.template + moved(head, eyeLookInLeft=1)
    assert turned[left, 0].mean() < head.template[left, 0].mean() - 1e-3
    assert np.ptp(turned[left, 1]) == pytest.approx(np.ptp(head.template[left, 1]), rel=0.1)


def test_colours_are_shares_of_materials_that_sum_to_one(head):
    total = sum(share.astype(int) for share in head.materials.values())
    assert set(total.tolist()) == {255}
    assert head.colours().shape == head.template.shape
    light, dark = (head.colours(n).mean() for n in ("caucasian-female-young", "african-male-young"))
    assert light > dark + 30
    assert {"lips", "iris", "pupil", "sclera", "teeth", "brow", "hair"} <= {
        name for name in head.materials if len(material(head, name))
    }


def test_saving_keeps_the_head(head, tmp_path):
    save_head(head, tmp_path / "again.npz")
    again = load_head(tmp_path / "again.npz")
    np.testing.assert_array_equal(again.unit_offsets, head.unit_offsets)
    np.testing.assert_array_equal(again.template, head.template)
    assert PACKAGED.stat().st_size < 700_000


def test_what_is_no_head_is_named(tmp_path, head):
    with pytest.raises(CorpusError, match=r"absent\.npz"):
        load_head(tmp_path / "absent.npz")
    with pytest.raises(CorpusError, match="51 columns; expected the 52"):
        head.offsets(np.zeros((3, 51)))
