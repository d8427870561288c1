"""Weights of face units: optimal in the box, on easy and on degenerate problems."""

import dataclasses

import numpy as np
import pytest
from conftest import SPEECH
from scipy.optimize import lsq_linear

from facecode.clip import Rig
from facecode.errors import NoRigError
from facecode.weights import RIDGE, solve_box, solve_weights


def problem(seed, n_frames=40, n_units=12, rank=None):
    """A Gram matrix with a small ridge, and right-hand sides with solutions at both bounds."""
    rng = np.random.default_rng(seed)
    units = rng.standard_normal((n_units, rank or 3 * n_units))
    units = units[:, : rank or None]
    gram = units @ units.T
    gram += 1e-4 * np.trace(gram) / n_units * np.eye(n_units)
    weights = rng.uniform(-0.7, 1.7, (n_frames, n_units))
    return gram, weights @ gram


def kkt(gram, wanted, weights):
    """The greatest violation of the conditions of optimality, relative to the scale."""
    gradient = weights @ gram - wanted
    free = (weights > 0) & (weights < 1)
    wrong = np.where(free, np.abs(gradient), 0)
    wrong = np.maximum(wrong, np.where(weights == 0, -gradient, 0))
    wrong = np.maximum(wrong, np.where(weights == 1, gradient, 0))
    return wrong.max() / np.abs(wanted).max()


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("rank", [None, 5])
def test_optimal_in_the_box(seed, rank):
    gram, wanted = problem(seed, rank=rank)
    weights = solve_box(gram, wanted)
    assert weights.min() >= 0
    assert weights.max() <= 1
    assert (weights == 0).any()
    assert (weights == 1).any()
    assert kkt(gram, wanted, weights) < 1e-6


@pytest.mark.parametrize("seed", range(3))
def test_as_bvls_of_scipy(seed):
    rng = np.random.default_rng(seed)
    deltas = rng.standard_normal((9, 20, 3)).astype(np.float32)
    offsets = np.tensordot(rng.uniform(-0.5, 1.5, (7, 9)), deltas, axes=1).astype(np.float32)
    got = solve_weights(offsets, deltas)
    flat = deltas.reshape(9, -1).astype(float)
    damp = np.sqrt(RIDGE * np.square(flat).sum() / 9) * np.eye(9)
    for frame, row in zip(offsets, got, strict=True):
        right = np.concatenate([frame.ravel(), np.zeros(9)])
        want = lsq_linear(np.vstack([flat.T, damp]), right, (0, 1), method="bvls", tol=1e-14).x
        np.testing.assert_allclose(row, want, atol=1e-6)


def least_squares(offsets, deltas, ridge, temporal, held=()):
    """Frame after frame by SciPy, on the rows of the problem as they stand."""
    flat = deltas.reshape(len(deltas), -1).astype(float)
    mean = np.square(flat).sum() / len(flat)
    eye, before, rows = np.eye(len(flat)), None, []
    for t, frame in enumerate(offsets):
        draw = np.sqrt(temporal * mean) if before is not None else 0
        left = np.vstack([flat.T, np.sqrt(ridge * mean) * eye, draw * eye])
        right = [frame.ravel(), np.zeros(len(flat)), draw * (0 if before is None else before)]
        right[2] = np.broadcast_to(right[2], len(flat))
        free = [k for k in range(len(flat)) if not len(held) or not held[t][k]]
        found = lsq_linear(left[:, free], np.concatenate(right), (0, 1), method="bvls", tol=1e-14)
        before = np.zeros(len(flat))
        before[free] = found.x
        rows.append(before)
    return np.array(rows)


@pytest.mark.parametrize("ridge", [0, 1e-2, 1])
@pytest.mark.parametrize("temporal", [0, 0.3, 5])
def test_options_for_units_of_ones_own(ridge, temporal):
    """Optimal in each frame, given the frame before; the more is asked, the calmer and smaller."""
    rng = np.random.default_rng(1)
    deltas = rng.standard_normal((6, 20, 3)).astype(np.float32)
    offsets = np.tensordot(rng.uniform(-0.5, 1.5, (70, 6)), deltas, axes=1).astype(np.float32)
    got = solve_weights(offsets, deltas, ridge=ridge, temporal=temporal)
    np.testing.assert_allclose(got, least_squares(offsets, deltas, ridge, temporal), atol=1e-6)
    plain = solve_weights(offsets, deltas, ridge=0)
    if temporal:
        assert np.abs(np.diff(got, axis=0)).mean() < 0.9 * np.abs(np.diff(plain, axis=0)).mean()


@pytest.mark.parametrize("temporal", [0, 0.3])
def test_pairs_that_cancel(temporal):
    """The smaller of a pair is 0, and the others are optimal without it."""
    rng = np.random.default_rng(2)
    deltas = rng.standard_normal((6, 20, 3)).astype(np.float32)
    deltas[1] = -deltas[0] + 0.3 * deltas[1]
    offsets = np.tensordot(rng.uniform(-0.5, 1.5, (70, 6)), deltas, axes=1).astype(np.float32)
    pairs = [(0, 1), (4, 3)]
    got = solve_weights(offsets, deltas, temporal=temporal, cancel=pairs)
    held = np.zeros(got.shape, bool)
    for pair in pairs:
        assert (got[:, pair] == 0).any(axis=1).all()
        held[:, pair] = got[:, pair] == 0
        held[:, pair[0]] &= ~held[:, pair[1]] | (got[:, pair[0]] > 0)
    want = least_squares(offsets, deltas, RIDGE, temporal, held)
    np.testing.assert_allclose(got, want, atol=1e-6)
    assert (got[:, [0, 4]] > 0).any()
    assert (got[:, [1, 3]] > 0).any()


def test_frames_beyond_a_chunk():
    """In turn or at once, in a solve of all frames or of some."""
    rng = np.random.default_rng(3)
    deltas = rng.standard_normal((5, 20, 3)).astype(np.float32)
    offsets = np.tensordot(rng.uniform(-0.5, 1.5, (130, 5)), deltas, axes=1).astype(np.float32)
    together = solve_weights(offsets, deltas)
    np.testing.assert_array_equal(together[64:128], solve_weights(offsets[64:128], deltas))
    nearly = solve_weights(offsets, deltas, temporal=1e-9)
    np.testing.assert_allclose(nearly, together, atol=1e-6)


def test_odd_rigs():
    rng = np.random.default_rng(0)
    deltas = rng.standard_normal((4, 6, 3)).astype(np.float32)
    deltas[1] = 0  # moves nothing
    deltas[3] = deltas[2]  # twice the same
    offsets = np.tensordot([[0.5, 0.0, 0.8, 0.0]], deltas, axes=1).astype(np.float32)
    weights = solve_weights(offsets, deltas)
    assert weights[0, 1] == 0
    np.testing.assert_allclose(weights[0, [0, 2, 3]], [0.5, 0.4, 0.4], atol=1e-3)
    assert not solve_weights(offsets, np.zeros_like(deltas)).any()
    assert solve_weights(offsets[:0], deltas).shape == (0, 4)
    for unit in (1e-3, 1.0, 1e3):  # metres or millimetres: the same weights
        same = solve_weights(unit * offsets, np.float32(unit) * deltas)
        np.testing.assert_allclose(same, weights, atol=1e-5)


def test_frames_do_not_depend_on_each_other():
    gram, wanted = problem(3)
    together = solve_box(gram, wanted)
    for row, alone in zip(wanted, together, strict=True):
        np.testing.assert_allclose(solve_box(gram, row[None])[0], alone, atol=1e-9)


def test_a_clip_with_a_rig_has_weights(tiny):
    clip = tiny.animate(SPEECH)
    with pytest.raises(NoRigError, match="need face units"):
        _ = clip.weights
    deltas = np.random.default_rng(0).standard_normal((3, 42, 3)).astype(np.float32) / 100
    rigged = dataclasses.replace(clip, rig=Rig(("jawOpen", "a", "b"), deltas))
    assert rigged.weights.shape == (212, 3)
    assert rigged.weights is rigged.weights  # solved once
    assert rigged.weight_names == ("jawOpen", "a", "b")


def test_a_frame_alone_has_the_bits_it_has_among_others():
    gram, wanted = problem(3, n_frames=70)
    together = solve_box(gram, wanted)
    for n in (1, 3, 64):
        apart = [solve_box(gram, wanted[start : start + n]) for start in range(0, 70, n)]
        assert np.array_equal(np.concatenate(apart), together)
