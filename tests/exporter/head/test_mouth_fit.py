"""A mouth that units made is found again; one that they cannot make comes as near as they can."""

import numpy as np
import pytest

from facecode_exporter.head.face_units import UNIT, unit_weights
from facecode_exporter.head.head import LIP_PAIR, load_head
from facecode_exporter.head.mouth_fit import MEASURES, RELUCTANCE, fit_mouth, unit_measures


@pytest.fixture(scope="module")
def head():
    return load_head()


def measured(head, weights):
    """(T, 7) of (T, 52) weights, straight from the vertices' units."""
    units = [UNIT[u] if u in UNIT else UNIT[f"{u}Left"] for u in RELUCTANCE]
    return weights[:, units] @ unit_measures(head)


def gap_mm(head, weights):
    moved = 1000 * head.offsets(weights)
    return moved[:, LIP_PAIR[0], 1] - moved[:, LIP_PAIR[1], 1]


def test_measures_are_those_of_the_vertices(head):
    open_wide = unit_weights(jawOpen=0.4, mouthUpperUp=0.3)[None]
    expected = gap_mm(head, open_wide)
    found = measured(head, open_wide)[:, list(MEASURES).index("gap")]
    assert found == pytest.approx(expected, rel=1e-4)


def test_a_mouth_that_units_made_keeps_its_gap(head):
    swing = np.sin(np.linspace(0, 6, 40))[:, None] ** 2
    weights = swing * unit_weights(jawOpen=0.4, mouthUpperUp=0.3, mouthStretch=0.2)
    fit = fit_mouth(measured(head, weights), np.zeros((40, 2)), head)
    assert fit.shape == (40, 52)
    assert (fit >= 0).all()
    assert (fit <= 1).all()
    assert np.abs(gap_mm(head, fit) - gap_mm(head, weights)).max() < 0.1
    difference = measured(head, fit) - measured(head, weights)
    assert np.sqrt(np.square(difference).mean()) < 1.0


def test_sides_move_alike_and_others_not_at_all(head):
    rng = np.random.default_rng(0)
    fit = fit_mouth(rng.normal(0, 4, (20, 7)), rng.uniform(0, 1, (20, 2)), head)
    assert np.array_equal(fit[:, UNIT["mouthSmileLeft"]], fit[:, UNIT["mouthSmileRight"]])
    moved = unit_weights(**dict.fromkeys(RELUCTANCE, 1.0)) > 0
    assert not fit[:, ~moved].any()


def test_scores_decide_how_far_lips_come_forward(head):
    still = np.zeros((10, 7))
    for column, unit in enumerate(("mouthPucker", "mouthFunnel")):
        scores = np.zeros((10, 2))
        scores[:, column] = 0.5
        assert fit_mouth(still, scores, head)[:, UNIT[unit]].min() > 0.1
        assert fit_mouth(still, np.zeros((10, 2)), head)[:, UNIT[unit]].max() < 0.01


def test_a_mouth_at_rest_is_the_neutral_face(head):
    assert not fit_mouth(np.zeros((5, 7)), np.zeros((5, 2)), head).any()
