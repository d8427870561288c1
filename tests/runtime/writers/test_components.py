"""Motion as a few shapes: the fewest that keep to a tolerance, at any length."""

import numpy as np
import pytest

from facecode.writers import components
from facecode.writers.components import components_of


def motion(n_frames, n_shapes=5, n_vertices=40, seed=0):
    rng = np.random.default_rng(seed)
    shapes = rng.standard_normal((n_shapes, n_vertices * 3)) * 0.3 ** np.arange(n_shapes)[:, None]
    weights = np.sin(rng.random(n_shapes) * np.arange(n_frames)[:, None] + np.arange(n_shapes))
    return (weights @ shapes).reshape(n_frames, n_vertices, 3).astype(np.float32)


def made(found):
    return [found.rest + np.tensordot(weights, found.shapes, 1) for weights in found.weights]


@pytest.mark.parametrize("n_frames", [1, 2, 30, components.CHUNK + 3, 3 * components.CHUNK])
@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-4])
def test_every_vertex_is_within_the_tolerance(n_frames, tolerance):
    given = motion(n_frames)
    found = components_of([given], tolerance)
    far = np.linalg.norm(made(found)[0] - given, axis=2).max()
    assert far <= tolerance
    assert found.error == pytest.approx(far, abs=1e-6)
    assert all(each.min() >= 0 and each.max() <= 1 for each in found.weights)


@pytest.mark.parametrize("n_frames", [100, 2 * components.CHUNK + 7])
def test_one_shape_less_would_not_do(n_frames):
    given = motion(n_frames)
    flat = given.reshape(n_frames, -1) - given.reshape(n_frames, -1).mean(axis=0)
    mix, strength, axes = np.linalg.svd(flat, full_matrices=False)
    for tolerance in (1.0, 0.3, 0.1, 0.03, 0.01):
        n_shapes = len(components_of([given], tolerance).shapes)
        left = flat - (mix[:, : n_shapes - 1] * strength[: n_shapes - 1]) @ axes[: n_shapes - 1]
        assert np.linalg.norm(left.reshape(n_frames, -1, 3), axis=2).max() > tolerance


def test_takes_share_their_shapes():
    given = [motion(40, seed=3), motion(40, seed=3)[::-1] * np.float32(0.5)]
    found = components_of(given, 1e-3)
    assert len(found.weights) == 2
    for there, wanted in zip(made(found), given, strict=True):
        assert np.abs(there - wanted).max() <= 1e-3


def test_a_face_that_does_not_move_has_one_shape_of_nothing():
    found = components_of([np.ones((9, 4, 3), np.float32)], 1e-4)
    assert found.shapes.shape == (1, 4, 3)
    assert not found.shapes.any()
    assert np.array_equal(made(found)[0], np.ones((9, 4, 3)))


def test_noise_takes_as_many_shapes_as_it_needs():
    given = np.random.default_rng(0).standard_normal((30, 50, 3)).astype(np.float32)
    found = components_of([given], 1e-4)
    assert len(found.shapes) <= 30
    assert found.error < 1e-4
