"""The neutral face as a mesh: the vertices, in their order, come back from other readers."""

import io

import numpy as np
import pytest
import trimesh
from gltf_reading import Glb
from small_faces import changed, rigged, still, with_rig

from facecode.bundle import Bundle
from facecode.cli.main import main
from facecode.errors import NoFacesError, OutputSuffixError
from facecode.writers.mesh import save_mesh
from facecode.writers.point_cache import PC2

NEAREST = 1e-12  # metres; .obj is text


def read(path):
    return trimesh.load(path, process=False, maintain_order=True)


@pytest.mark.parametrize("suffix", [".obj", ".ply"])
def test_vertices_and_triangles_keep_their_order(tmp_path, suffix):
    clip = rigged()
    path = tmp_path / f"neutral{suffix.upper()}"
    save_mesh(still(clip), path)
    mesh = read(path)
    assert np.abs(mesh.vertices - clip.template).max() <= NEAREST
    assert np.array_equal(mesh.faces, clip.faces)
    assert np.array_equal(mesh.visual.vertex_colors[:, :3], clip.colours)
    save_mesh(changed(still(clip), colours=None), path)
    assert np.array_equal(read(path).faces, clip.faces)


def test_it_is_the_rest_of_a_point_cache(tmp_path):
    clip = changed(rigged(2), metres_per_unit=0.01, up_axis="z")
    resting = changed(clip, offsets=np.zeros_like(clip.offsets))
    file = io.BytesIO()
    PC2.write(resting, file, False)
    cached = np.frombuffer(file.getvalue()[32:], "<f4").reshape(2, -1, 3)
    save_mesh(still(clip), tmp_path / "neutral.obj")
    assert np.abs(read(tmp_path / "neutral.obj").vertices - cached[1]).max() <= NEAREST


def test_a_glb_has_the_units_as_shapes_and_no_animation(tmp_path):
    clip = rigged()
    save_mesh(still(clip), tmp_path / "neutral.glb")
    glb = Glb((tmp_path / "neutral.glb").read_bytes())
    assert "animations" not in glb.tree
    assert glb.mesh_of(0)["extras"]["targetNames"] == list(clip.rig.names)
    save_mesh(with_rig(still(clip), None), tmp_path / "plain.glb")
    plain = Glb((tmp_path / "plain.glb").read_bytes())
    assert "targets" not in plain.mesh_of(0)["primitives"][0]
    assert np.array_equal(plain.attribute(0, "POSITION"), clip.template)


def test_what_cannot_be_written(tmp_path):
    with pytest.raises(OutputSuffixError, match=r"\.obj, \.ply, \.glb"):
        save_mesh(still(rigged()), tmp_path / "a.stl")
    with pytest.raises(NoFacesError):
        save_mesh(changed(still(rigged()), faces=None), tmp_path / "a.obj")
    assert not list(tmp_path.iterdir())


def test_the_command_takes_identities(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["mesh", "-o", "neutral.obj"]) == 0
    bundle = Bundle.open("demo")
    assert np.abs(read("neutral.obj").vertices - bundle.template).max() <= NEAREST
    other = list(bundle.manifest.identities)[-1]
    assert main(["mesh", "--template", other, "-o", "other.ply"]) == 0
    assert np.array_equal(np.float32(read("other.ply").vertices), bundle.neutral(other))
    assert main(["mesh", "-o", "none/neutral.obj"]) == 2
    assert "does not exist" in capsys.readouterr().err
