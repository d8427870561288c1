"""Codebook, buffers, styles, templates: the small pieces."""

import numpy as np
import pytest
import trimesh

from facecode.buffers import GrowingBuffer, KeyValueCache
from facecode.codebook import Codebook
from facecode.errors import ModeError, StyleError, StyleWarning, TemplateError
from facecode.request import window_frames
from facecode.styles import parse_style, style_weights
from facecode.template import load_template, read_mesh

NAMES = ("calm", "lively", "FaceTalk_170728_03272_TA")


def test_nearest_is_the_smallest_distance():
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((57, 11)).astype(np.float32)
    features = rng.standard_normal((2, 5, 11)).astype(np.float32)
    distance = np.linalg.norm(features[:, :, None].astype(float) - rows, axis=-1)
    book = Codebook(rows)
    np.testing.assert_array_equal(book.nearest(features), distance.argmin(-1))
    np.testing.assert_array_equal(book.nearest(book.look_up(np.arange(57))), np.arange(57))


def test_ties_go_to_the_lower_code_in_numpy_and_in_the_graph(tiny):
    rows = tiny.parts[0].codebook.rows
    middle = (rows[3] + rows[17]) / 2
    book = Codebook(np.array([[1, 0], [0, 1], [1, 0], [-1, 0]], np.float32))
    assert book.nearest(np.array([[0.5, 0.5], [1, 0], [0, 0]], np.float32)).tolist() == [0, 0, 0]
    features = np.concatenate([rows, [middle]]).astype(np.float32)
    features = np.resize(features, (1, 33, 4, rows.shape[1]))
    (codes,) = tiny.parts[0].motion.run(("codes",), features, np.array([0]))
    np.testing.assert_array_equal(codes, tiny.parts[0].codebook.nearest(features))


def test_buffer_grows_and_keeps_its_rows():
    buffer = GrowingBuffer(2, (3,), capacity=2)
    rows = np.arange(7 * 2 * 3, dtype=np.float32).reshape(7, 2, 3)
    for row in rows:
        buffer.append(row)
    np.testing.assert_array_equal(buffer.view(), rows.transpose(1, 0, 2))


def frame(t: int, n_batch: int) -> np.ndarray:
    """Rows (2 layers, batch, 4) that tell frame, clip and channel apart."""
    clip = t + np.arange(n_batch)[:, None] / 8 + np.arange(4) / 64
    return np.stack([clip, 1000 + clip]).astype(np.float32)


@pytest.mark.parametrize("n_batch", [1, 3])
@pytest.mark.parametrize("limit", [None, 100])
def test_keys_stand_in_their_slots_head_by_head_and_are_not_copied(n_batch, limit):
    cache = KeyValueCache(n_layers=2, n_batch=n_batch, dim=4, n_heads=2, limit=limit)
    assert list(cache.inputs()) == ["past_keys_0", "past_keys_1", "past_values_0", "past_values_1"]
    for t in range(250):
        n = n_batch if t < 120 else 1
        cache.append(frame(t, n), frame(t, n) - 0.5)
        inputs = cache.inputs(n)
        assert all(rows.flags.c_contiguous and rows.base is not None for rows in inputs.values())
        keys, values = inputs["past_keys_1"], inputs["past_values_1"]
        oldest = 0 if limit is None else max(0, t + 1 - limit)
        assert t + 1 - oldest <= keys.shape[2] <= (limit or 1.125 * (t + 33))
        for past in range(oldest, t + 1):
            slot = past % keys.shape[2]
            rows = frame(past, n)[1].reshape(n, 2, 2)
            np.testing.assert_array_equal(keys[:, :, slot], rows)
            np.testing.assert_array_equal(values[:, :, slot], rows - 0.5)


def test_keys_for_older_bundles_stand_in_order():
    cache = KeyValueCache(n_layers=2, n_batch=2, dim=4, n_heads=None, limit=100)
    assert cache.inputs()["past_keys_1"].shape == (2, 0, 4)
    for t in range(250):
        cache.append(frame(t, 2), frame(t, 2))
        rows = cache.inputs(1)["past_values_0"]
        np.testing.assert_array_equal(rows[0, :, 0], range(max(0, t - 99), t + 1))


def test_styles():
    assert style_weights(None, NAMES).tolist() == [1, 0, 0]
    assert style_weights("lively", NAMES).tolist() == [0, 1, 0]
    mixed = style_weights(parse_style("calm:0.25, lively:0.75"), NAMES)
    assert mixed.tolist() == [0.25, 0.75, 0]
    assert mixed.dtype == np.float32


def test_unknown_style_names_the_nearest():
    with pytest.raises(StyleError, match="no style 'clam'; nearest: calm"):
        style_weights("clam", NAMES)
    with pytest.raises(StyleError, match="nearest: FaceTalk_170728_03272_TA"):
        style_weights("facetalk_170728_03272", NAMES)


@pytest.mark.parametrize("text", ["calm:x", "calm:0.5,lively", ":"])
def test_unreadable_mix(text):
    with pytest.raises(StyleError, match=r"a:0\.3,b:0\.7"):
        parse_style(text)


@pytest.mark.parametrize("mix", [{}, {"calm": float("nan")}, {"calm": "1"}])
def test_mix_that_is_none(mix):
    with pytest.raises(StyleError):
        style_weights(mix, NAMES)


def test_mix_that_does_not_sum_to_one_is_used_and_said():
    with pytest.warns(StyleWarning, match="sum to 1.5"):
        assert style_weights({"calm": 1, "lively": 0.5}, NAMES).tolist() == [1, 0.5, 0]


def test_window_frames():
    assert window_frames("exact", None) is None
    assert window_frames("window", 5) == 5
    assert window_frames("window", None, 7) == 7
    for mode, window in (("exact", 5), ("window", 2), ("fast", None)):
        with pytest.raises(ModeError):
            window_frames(mode, window)


@pytest.fixture
def mesh():
    return trimesh.creation.box()


@pytest.mark.parametrize("suffix", ["ply", "obj"])
def test_mesh_files_keep_their_order(tmp_path, mesh, suffix):
    file = tmp_path / f"box.{suffix}"
    mesh.export(file)
    vertices, faces = read_mesh(file)
    np.testing.assert_allclose(vertices, mesh.vertices, atol=1e-6)
    np.testing.assert_array_equal(faces, mesh.faces)
    assert load_template(file, 8).dtype == np.float32


def test_ply_keeps_vertices_without_a_face(tmp_path, mesh):
    mesh.vertices = np.concatenate([mesh.vertices, [[9, 9, 9]]])
    mesh.export(tmp_path / "box.ply")
    assert read_mesh(tmp_path / "box.ply")[0].tolist() == mesh.vertices.tolist()
    trimesh.PointCloud(mesh.vertices).export(tmp_path / "points.ply")
    vertices, faces = read_mesh(tmp_path / "points.ply")
    assert (len(vertices), faces) == (9, None)


def test_obj_with_texture_seams_and_quads(tmp_path):
    file = tmp_path / "quad.OBJ"
    file.write_text(
        "mtllib none.mtl\no quad\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9\n"
        "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt .5 .5\nvn 0 0 1\nusemtl none\n"
        "f 1/1/1 2/2/1 3/3/1 4/4/1\nf 1/5/1 3/3/1 2/1/1\n"
    )
    vertices, faces = read_mesh(file)
    assert vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [9, 9, 9]]
    assert faces.max() == 3


def test_npy_and_arrays(tmp_path):
    np.save(tmp_path / "t.npy", np.eye(3))
    np.testing.assert_array_equal(load_template(tmp_path / "t.npy", 3), np.eye(3))
    np.testing.assert_array_equal(load_template(np.eye(3), 3), np.eye(3))


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((4, 3)), "has 4 vertices; this bundle animates 3"),
        (np.zeros((3, 2)), r"shape \(3, 2\)"),
        (np.zeros(9), r"shape \(9,\)"),
        (np.full((3, 3), np.nan), "not finite"),
    ],
)
def test_bad_template_arrays(array, message):
    with pytest.raises(TemplateError, match=message):
        load_template(array, 3)


@pytest.mark.parametrize("name", ["t.npy", "t.ply", "t.obj"])
def test_broken_template_files(tmp_path, name):
    (tmp_path / name).write_bytes(b"\x93broken")
    with pytest.raises(TemplateError):
        load_template(tmp_path / name, 3)


def test_missing_and_unknown_templates(tmp_path):
    with pytest.raises(TemplateError, match="no template file"):
        load_template(tmp_path / "none.ply", 3)
    (tmp_path / "t.stl").touch()
    with pytest.raises(TemplateError, match=r"expected \.npy, \.ply or \.obj"):
        load_template(tmp_path / "t.stl", 3)


def test_pickled_templates_are_refused(tmp_path):
    np.save(tmp_path / "t.npy", np.array([object()]), allow_pickle=True)
    with pytest.raises(TemplateError, match="cannot be read"):
        load_template(tmp_path / "t.npy", 3)
