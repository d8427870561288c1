import numpy as np
import pytest

from facecode_exporter.measures.signals import (
    LONGEST_LAG,
    Lag,
    accelerations,
    best_lag,
    lag_correlations,
    pops,
)

CURVE = np.random.default_rng(0).normal(size=60).astype(np.float32)


@pytest.mark.parametrize("late", [-10, -3, 0, 1, 10])
def test_lag_is_positive_for_a_late_curve(late):
    moved = np.roll(CURVE, late)
    lag = best_lag([lag_correlations(3 * moved + 1, CURVE)])
    assert lag is not None
    assert lag.frames == late
    assert lag.correlation == pytest.approx(1, abs=1e-6)


def test_correlation_by_hand():
    # (-1, 0, 1, 0, ...) against (-1, 1, 0, 0, ...): products 1 + 0 + 0, squares 2 and 2.
    a, b = np.zeros(8), np.zeros(8)
    a[:3], b[:3] = (-1, 0, 1), (-1, 1, 0)
    correlations = lag_correlations(a, b)
    assert correlations[LONGEST_LAG] == pytest.approx(1 / 2)
    assert np.isnan(np.delete(correlations, LONGEST_LAG)).all()  # fewer than 8 frames overlap


def test_clips_are_averaged_before_the_best_lag_is_chosen():
    first, second = np.full((2, 2 * LONGEST_LAG + 1), np.nan)
    first[LONGEST_LAG], first[LONGEST_LAG + 2] = 0.5, 0.9
    second[LONGEST_LAG], second[LONGEST_LAG + 2] = 0.7, -0.1
    assert best_lag([first, second]) == Lag(0, pytest.approx(0.6))
    assert best_lag([first]) == Lag(2, pytest.approx(0.9))


def test_of_equal_correlations_the_smallest_shift_wins():
    assert best_lag([np.full(2 * LONGEST_LAG + 1, 0.25)]) == Lag(0, 0.25)


@pytest.mark.parametrize("curve", [np.zeros(60), np.full(60, 0.1, np.float32), np.zeros(3)])
def test_a_constant_or_short_curve_has_no_lag(curve):
    assert best_lag([lag_correlations(curve, CURVE)]) is None
    assert best_lag([]) is None


def test_acceleration_by_hand():
    # Two vertices at 10 fps; one jumps by 3 along x in frame 2 of 5: 3, -6, 3 times 100, the other
    # rests, and the root mean square over two vertices divides by sqrt(2).
    vertices = np.zeros((5, 2, 3), np.float32)
    vertices[2, 1, 0] = 3
    expected = np.array([300, 600, 300]) / np.sqrt(2)
    np.testing.assert_allclose(accelerations(vertices, 10), expected)
    assert pops(vertices, 10) == pytest.approx(np.percentile(expected, 99))


def test_uniform_motion_does_not_pop():
    vertices = np.arange(200, dtype=np.float32)[:, None, None] * np.ones((1, 4, 3), np.float32)
    assert pops(vertices, 30) == 0
    assert pops(vertices[:2], 30) is None


def test_chunks_leave_no_seam():
    vertices = np.random.default_rng(1).normal(size=(150, 3, 3))
    second = np.diff(vertices, n=2, axis=0) * 30**2
    expected = np.sqrt((second**2).sum(axis=2).mean(axis=1))
    np.testing.assert_allclose(accelerations(vertices, 30), expected)
