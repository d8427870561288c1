"""Nearest code and look-up."""

import numpy as np

from facecode.loop.part import Codebook


def test_nearest_is_the_smallest_distance():
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((57, 11)).astype(np.float32)
    features = rng.standard_normal((2, 5, 11)).astype(np.float32)
    distance = np.linalg.norm(features[:, :, None].astype(float) - rows, axis=-1)
    book = Codebook(rows)
    np.testing.assert_array_equal(book.nearest(features), distance.argmin(-1))
    np.testing.assert_array_equal(book.nearest(book.look_up(np.arange(57))), np.arange(57))


def test_ties_go_to_the_lower_code_in_numpy_and_in_the_graph(tiny):
    rows = tiny.engine.parts[0].codebook.rows
    middle = (rows[3] + rows[17]) / 2
    book = Codebook(np.array([[1, 0], [0, 1], [1, 0], [-1, 0]], np.float32))
    assert book.nearest(np.array([[0.5, 0.5], [1, 0], [0, 0]], np.float32)).tolist() == [0, 0, 0]
    features = np.concatenate([rows, [middle]]).astype(np.float32)
    features = np.resize(features, (1, 33, 4, rows.shape[1]))
    (codes,) = tiny.engine.parts[0].motion.run(("codes",), features, np.array([0]))
    np.testing.assert_array_equal(codes, tiny.engine.parts[0].codebook.nearest(features))
