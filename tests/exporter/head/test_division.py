"""The demo head in two parts: every vertex once, and a border that cuts through little motion."""

import numpy as np
import pytest

from facecode_exporter.head.division import part_vertices, seam_edges, stretch
from facecode_exporter.head.face_units import unit_weights
from facecode_exporter.head.head import LIP_PAIR, load_head
from facecode_spec.systems.cdface_demo import SPEC


@pytest.fixture(scope="module")
def head():
    return load_head()


@pytest.fixture(scope="module")
def parts(head):
    return part_vertices(head)


def test_parts_are_those_of_the_spec(head, parts):
    assert list(parts) == [p.name for p in SPEC.parts]
    assert [len(v) for v in parts.values()] == [p.n_vertices for p in SPEC.parts]
    np.testing.assert_array_equal(np.sort(np.concatenate(list(parts.values()))), np.arange(5886))
    assert np.isin(head.regions["lips"], parts["lips"]).all()
    assert np.isin(LIP_PAIR, parts["lips"]).all()


def test_the_border_lies_where_little_moves(head, parts):
    """Jaw wide open, a smile, a squint: at the border less than a tenth of what they do at most."""
    edges = seam_edges(head.faces, parts["lips"])
    assert len(edges) > 50
    for shape in (unit_weights(jawOpen=1.0), unit_weights(eyeBlink=1.0)):
        moved = np.linalg.norm(head.offsets(shape[None])[0], axis=1)
        assert np.median(moved[edges]) < 0.1 * moved.max()


def test_a_jump_across_the_border_shows_as_stretch(head, parts):
    edges = seam_edges(head.faces, parts["lips"])
    vertices = np.stack([head.template] * 2)
    assert (stretch(vertices, head.template, edges) == 0).all()
    vertices[1, parts["lips"]] += [0.0, -0.002, 0.0]
    jump = stretch(vertices, head.template, edges)
    assert abs(jump[1]).max() > 1e-3
    assert abs(jump[0]).max() == 0
