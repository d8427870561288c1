"""Where a picture has several samples a pixel, and that they are drawn as all of them would be."""

import numpy as np
import pytest
from test_video import ball

from facecode.render import light, raster
from facecode.render.outline import Outline, steps
from facecode.render.picture import Renderer
from facecode.render.region import SAMPLES, Region


def triangles(rng, size, n=60):
    """Random ones, some partly outside; some have a corner twice."""
    screen = rng.uniform(-0.3, 1.3, (3, 40)).astype(np.float32)
    screen[:2] *= [[size[1]], [size[0]]]
    screen[2] += 1
    return screen, rng.integers(0, 40, (n, 3)).astype(np.int32)


@pytest.mark.parametrize("size", [(64, 64), (37, 51), (1, 1)])
@pytest.mark.parametrize("share", [0, 0.05, 1])
def test_samples_of_a_region_are_those_of_the_whole_picture(size, share):
    rng = np.random.default_rng(5)
    screen, faces = triangles(rng, size)
    screen[0, 7] = np.nan
    mask = rng.uniform(size=size) < share
    keys = raster.draw_samples(screen, faces, Region(mask))
    fine = screen * np.array([[SAMPLES], [SAMPLES], [1]], np.float32)
    every = raster.draw(fine, faces, (SAMPLES * size[0], SAMPLES * size[1]))
    every = every.reshape(size[0], SAMPLES, size[1], SAMPLES).swapaxes(1, 2)[mask]
    np.testing.assert_array_equal(keys.swapaxes(0, 1), every)


def test_nothing_is_drawn_without_triangles():
    screen, faces = np.ones((3, 4), np.float32), np.zeros((0, 3), np.int32)
    assert not raster.draw(screen, faces, (8, 9)).any()
    assert not raster.draw_samples(screen, faces, Region(np.ones((8, 9), bool))).any()


def test_steps_are_found_and_slopes_are_not():
    near = np.linspace(0.2, 0.4, 30, dtype=np.float32) + np.zeros((20, 1), np.float32)  # a plane
    piece = np.zeros(near.shape, np.int64)
    assert not steps(near, piece).any()
    near[:, 12:] += 0.01
    piece[7:, :5] = 3
    found = steps(near, piece)
    expected = np.zeros_like(found)
    expected[:, 11:13] = True
    expected[6:8, :5] = expected[7:, 4:6] = True
    np.testing.assert_array_equal(found, expected)


def test_a_slit_thinner_than_a_pixel_is_found():
    """Between two rows of centres, over a farther plane: only its edges tell."""
    corners = [(1, 1), (19, 1), (19, 9.6), (1, 9.6), (1, 10.4), (19, 10.4), (19, 19), (1, 19)]
    corners += [(1, 1), (19, 1), (19, 19), (1, 19)]
    screen = np.array([(*at, 0.5 if i < 8 else 0.4) for i, at in enumerate(corners)], np.float32).T
    faces = np.array(
        [(i + a, i + b, i + c) for i in (0, 4, 8) for a, b, c in ((0, 1, 2), (0, 2, 3))]
    )
    near = raster.nearness_of(raster.draw(screen, faces, (20, 20))).reshape(20, 20)
    assert (near[9:11, 2:18] == 0.5).all()  # no centre shows it
    found = np.zeros(near.size, bool)
    facing = np.ones(len(faces), bool)
    found[Outline(faces).pixels(screen, near, facing, two_sided=False)] = True
    assert found.reshape(near.shape)[9:11, 2:18].all()


def test_edges_hidden_behind_the_face_do_not_count():
    square = [(2, 2), (18, 2), (18, 18), (2, 18)]
    screen = np.array([(x, y, 0.5) for x, y in square] + [(x / 2 + 5, y / 2 + 5, 0.4)
                      for x, y in square], np.float32).T  # fmt: skip
    faces = np.array([(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
    near = raster.nearness_of(raster.draw(screen, faces, (20, 20))).reshape(20, 20)
    found = Outline(faces).pixels(screen, near, np.ones(4, bool), two_sided=True)
    row, column = np.divmod(np.unique(found), 20)
    assert set(np.minimum(np.minimum(row, 18 - row), np.minimum(column, 18 - column))) <= {0, 1, 2}


def test_edges_are_as_smooth_as_those_of_a_large_picture_made_small():
    """A ball whose half is inside another: an outline, and a line where the two meet."""
    template, faces = ball(24)
    template = np.concatenate([template, template * 0.7 + np.float32([0.6, 0.2, 0.5])])
    faces = np.concatenate([faces, faces + len(template) // 2])
    still = np.zeros((1, *template.shape), np.float32)
    size, times = 96, 8
    small, large = (
        Renderer(template, still, faces, None, side).frame(0) for side in (size, size * times)
    )
    mean = light.linear(large).reshape(size, times, size, times, 3).mean(axis=(1, 3))
    difference = np.abs(light.linear(small) - mean).max(axis=2)
    print(f"\nmean {difference.mean():.4f}, largest {difference.max():.3f}")
    assert difference.mean() < 0.004  # of 1, the white of the screen
    assert difference.max() < 0.15  # one sample of four is 0.25 of the step at an edge
