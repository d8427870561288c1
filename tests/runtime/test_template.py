"""Neutral faces from files and arrays: order kept, mistakes named."""

import numpy as np
import pytest
import trimesh

from facecode.bundle import Bundle
from facecode.errors import TemplateError
from facecode.template import load_template, read_mesh


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


@pytest.fixture(scope="module")
def packaged():
    return Bundle.open("demo")


def turned(vertices, axis, degrees):
    matrix = trimesh.transformations.rotation_matrix(np.radians(degrees), axis)[:3, :3]
    return vertices @ matrix.T


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda v: v * 1000, "1e.03 times as large as the bundle's own face, whose unit is metres"),
        (lambda v: v / 100, "0.01 times as large"),
        (lambda v: v * 0, "0 times as large"),
        (lambda v: v * 1e30, "times as large"),
        (lambda v: v[np.random.default_rng(0).permutation(len(v))], "without re-ordering"),
        (lambda v: turned(v, [1, 0, 0], 90), "turned by 90 degrees"),
        (lambda v: turned(v, [0, 1, 0], 180), "turned by 180 degrees"),
        (lambda v: v * [-1, 1, 1], "mirrored"),
        (lambda v: v[:, [0, 2, 1]], "mirrored"),
    ],
)
def test_a_template_that_is_no_such_head_is_refused(packaged, change, message):
    with pytest.raises(TemplateError, match=message):
        packaged.neutral(change(packaged.template))


@pytest.mark.parametrize("scale", [0.6, 1.7])
def test_heads_of_other_people_sizes_and_places_pass(packaged, scale):
    for name in packaged.manifest.identities:
        packaged.neutral(packaged.identity(name) * scale + np.float32([0, 1.6, 0]))
    packaged.neutral(turned(packaged.template, [1, 0, 0], 20))
    packaged.neutral(packaged.template * [1.4, 0.8, 1.1])


def test_names_that_are_no_identity(packaged):
    with pytest.raises(TemplateError, match="the identities are"):
        packaged.neutral("nobody")


@pytest.mark.parametrize("text", ["skin.png", "../../skin.png", "/etc/hostname"])
def test_pictures_that_a_ply_names_are_not_looked_for(tmp_path, mesh, text, caplog, capfd):
    file = tmp_path / "box.ply"
    mesh.export(file)
    head, end, rest = file.read_bytes().partition(b"element vertex")
    file.write_bytes(head + f"comment TextureFile {text}\n".encode() + end + rest)
    np.testing.assert_allclose(read_mesh(file)[0], mesh.vertices, atol=1e-6)
    assert not caplog.records
    assert capfd.readouterr() == ("", "")
