"""Every expected number is derived in the test, on meshes of two to four vertices."""

import numpy as np
import pytest

from facecode_exporter.errors import EvaluationError
from facecode_exporter.measures.metrics import (
    Score,
    face_dynamics_deviation,
    lip_vertex_error,
    mean_vertex_error,
    pooled,
    score,
)
from facecode_exporter.measures.regions import Regions

LIPS, UPPER = np.array([0, 1], np.int32), np.array([2], np.int32)
TEMPLATE = np.zeros((3, 3), np.float32)


def still(n_frames, n_vertices=3):
    return np.zeros((n_frames, n_vertices, 3), np.float32)


def test_lve_is_the_mean_over_frames_of_the_largest_squared_error_of_the_lips():
    truth, prediction = still(2), still(2)
    prediction[0, 0] = (3, 4, 0)  # 25
    prediction[0, 1] = (0, 0, 6)  # 36, the larger of frame 0
    prediction[1, 1] = (0, 2, 0)  # 4
    prediction[:, 2] = 100  # no lip
    assert lip_vertex_error(prediction, truth, LIPS) == (36 + 4) / 2


def test_fdd_is_truth_minus_prediction_of_the_deviation_of_squared_offsets():
    # |offset|^2 of the truth over time: 0, 4 -> std 2; of the prediction: 1, 9 -> std 4.
    truth, prediction = still(2), still(2)
    truth[1, 2] = (0, 2, 0)
    prediction[0, 2], prediction[1, 2] = (1, 0, 0), (0, 0, 3)
    assert face_dynamics_deviation(prediction, truth, TEMPLATE, UPPER) == 2 - 4
    assert face_dynamics_deviation(truth, prediction, TEMPLATE, UPPER) == 4 - 2


def test_fdd_looks_at_offsets_from_the_template():
    template = np.full((3, 3), 5, np.float32)
    truth = still(2) + template
    prediction = truth.copy()
    prediction[1, 2] += (0, 0, 2)  # 0, 4 -> std 2
    assert face_dynamics_deviation(prediction, truth, template, UPPER) == -2


def test_fdd_averages_over_vertices_after_the_deviation():
    # Two vertices that move in turn: their mean is steady, their deviations are not.
    truth, prediction = still(2), still(2)
    prediction[0, 1] = prediction[1, 2] = (2, 0, 0)  # each 4, 0 -> std 2
    assert face_dynamics_deviation(prediction, truth, TEMPLATE, np.array([1, 2])) == -2


def test_mve_is_the_mean_distance():
    truth, prediction = still(2), still(2)
    prediction[0, 0] = (3, 4, 0)  # 5
    prediction[1, 2] = (0, 0, 1)  # 1
    assert mean_vertex_error(prediction, truth) == pytest.approx(6 / 6)


@pytest.mark.parametrize(("n_predicted", "n_true"), [(2, 4), (4, 2)])
def test_the_longer_one_is_cut_at_its_end(n_predicted, n_true):
    prediction, truth = still(n_predicted), still(n_true)
    prediction[1, 0] = (2, 0, 0)
    prediction[2:] += 50
    truth[2:] -= 50
    result = score(prediction, truth, TEMPLATE, Regions(LIPS, UPPER))
    assert result == Score(2, lve=(0 + 4) / 2, fdd=0.0, mve=pytest.approx(2 / 6))


def test_clips_are_pooled_by_frames_for_lve_and_by_clips_for_fdd():
    long, short = Score(9, lve=1.0, fdd=1.0, mve=2.0), Score(1, lve=11.0, fdd=-3.0, mve=12.0)
    assert pooled([long, short]) == Score(10, lve=(9 + 11) / 10, fdd=-1.0, mve=(18 + 12) / 10)


def test_pooled_clips_equal_their_frames_in_one_array():
    rng = np.random.default_rng(0)
    clips = [tuple(rng.normal(size=(2, n, 3, 3)).astype(np.float32)) for n in (3, 8)]
    regions = Regions(LIPS, UPPER)
    ours = pooled(score(p, t, TEMPLATE, regions) for p, t in clips)
    whole = [np.concatenate([c[i] for c in clips]) for i in (0, 1)]
    assert ours.lve == pytest.approx(lip_vertex_error(*whole, LIPS))
    assert ours.mve == pytest.approx(mean_vertex_error(*whole))


def test_meshes_that_differ_and_empty_clips_are_refused():
    regions = Regions(LIPS, UPPER)
    with pytest.raises(EvaluationError, match=r"4 vertices, the truth 3.*topology"):
        score(still(2, 4), still(2), TEMPLATE, regions)
    with pytest.raises(EvaluationError, match="0 and 2 frames"):
        score(still(0), still(2), TEMPLATE, regions)
    with pytest.raises(EvaluationError, match="no clips"):
        pooled([])
