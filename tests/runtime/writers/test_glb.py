"""Heads as .glb: what a reader of the specification finds in the file."""

import io

import numpy as np
import pytest
from gltf_reading import Glb
from small_faces import NAMES, ball, changed, rigged

from facecode import writers
from facecode.clip import Clip, Rig
from facecode.errors import NoFacesError
from facecode.writers.glb import GLB
from facecode.writers.shapes import APART, TOLERANCE_MM


def written(clips):
    file = io.BytesIO()
    writers.write(clips, file, GLB)
    return Glb(file.getvalue())


def plain(clip):
    return changed(clip, rig=None)


def test_frames_are_the_clips(tmp_path):
    clip = rigged(7, fps=25.0)
    glb = written(clip)
    assert np.abs(glb.positions(0) - clip.vertices).max() < 1e-6
    times, weights = glb.weights(0)
    assert np.array_equal(times, np.float32(np.arange(7) / 25))
    assert np.array_equal(weights, clip.weights)
    assert glb.tree["meshes"][0]["extras"]["targetNames"] == list(NAMES)
    assert [node["name"] for node in glb.tree["nodes"]] == ["face"]
    assert glb.tree["asset"]["generator"].startswith("facecode ")
    path = tmp_path / "odd näme 'x'.GLB"
    writers.save(clip, path)
    assert Glb(path.read_bytes()).text == glb.text


def test_units_are_sparse_and_those_that_move_nothing_are_there():
    glb = written(rigged())
    targets = glb.tree["meshes"][0]["primitives"][0]["targets"]
    sparse = [glb.tree["accessors"][each["POSITION"]]["sparse"]["count"] for each in targets]
    moved = np.count_nonzero(rigged().rig.deltas.any(axis=2), axis=1)
    assert sparse == [*moved[:-1], 1]
    assert glb.mesh_of(0)["weights"] == [0] * len(NAMES)


def test_normals_look_outwards_however_the_triangles_turn():
    clip = rigged()
    radial = clip.template / np.linalg.norm(clip.template, axis=1, keepdims=True)
    for faces in (clip.faces, clip.faces[:, ::-1]):
        glb = written(changed(clip, faces=faces))
        normals = glb.attribute(0, "NORMAL")
        assert np.abs(np.linalg.norm(normals, axis=1) - 1).max() < 1e-6
        assert (normals * radial).sum(axis=1).min() > 0.9
        corners = clip.template[glb.accessor(glb.mesh_of(0)["primitives"][0]["indices"])]
        one, two, three = corners.reshape(-1, 3, 3).transpose(1, 0, 2)
        assert ((np.cross(two - one, three - one) * one).sum(axis=1) > 0).all()


def test_colours_are_linear():
    red, green, blue, alpha = written(rigged()).attribute(0, "COLOR_0")[0]
    assert red == pytest.approx(((200 / 255 + 0.055) / 1.055) ** 2.4, abs=1e-5)
    assert green == pytest.approx(((60 / 255 + 0.055) / 1.055) ** 2.4, abs=1e-5)
    assert (blue, alpha) == (0, 1)


def test_a_face_without_colours_is_clay():
    glb = written(rigged(colours=None))
    assert "COLOR_0" not in glb.mesh_of(0)["primitives"][0]["attributes"]
    colour = glb.tree["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"]
    assert len(colour) == 4
    assert all(0 < channel <= 1 for channel in colour)


@pytest.mark.parametrize("up_axis", ["x", "y", "z", None])
@pytest.mark.parametrize("per_unit", [0.01, None])
def test_the_file_is_in_metres_and_y_up(up_axis, per_unit):
    clip = rigged()
    turn = {"x": [1, 0, 2], "z": [0, 2, 1]}.get(up_axis, [0, 1, 2])  # its own inverse
    sign = {"x": [1, -1, 1], "z": [1, -1, 1]}.get(up_axis, [1, 1, 1])

    def turned(points):
        return (points[..., turn] * np.float32(sign) / np.float32(per_unit or 1)).astype(np.float32)

    other = changed(
        clip,
        template=turned(clip.template),
        offsets=turned(clip.offsets),
        rig=Rig(NAMES, turned(clip.rig.deltas)),
        up_axis=up_axis,
        metres_per_unit=per_unit,
    )
    for each in (other, plain(other)):
        assert np.abs(written(each).positions(0) - clip.vertices).max() < 1.1e-4
    assert np.abs(written(other).positions(0) - clip.vertices).max() < 1e-6


def test_without_a_rig_components_keep_to_the_tolerance():
    clip = plain(rigged(20))
    glb = written(clip)
    far = 1000 * np.linalg.norm(glb.positions(0) - clip.vertices, axis=2).max()
    extras = glb.tree["asset"]["extras"]
    assert far <= TOLERANCE_MM
    assert extras["greatest_error_mm"] == pytest.approx(far, abs=1e-3)
    assert extras["tolerance_mm"] == TOLERANCE_MM
    _, weights = glb.weights(0)
    assert weights.min() == 0
    assert weights.max() == 1
    assert extras["components"] == weights.shape[1] == 3  # units that move something
    assert glb.mesh_of(0)["weights"] == weights[0].tolist()


@pytest.mark.parametrize("clip", [rigged(1), plain(rigged(1))])
def test_one_frame(clip):
    glb = written(clip)
    assert np.abs(glb.positions(0) - clip.vertices).max() < 1e-6
    assert glb.weights(0)[0].tolist() == [0]


@pytest.mark.parametrize("rig", [True, False])
def test_takes_stand_side_by_side(rig):
    clips = [rigged(6, seed=0), changed(rigged(6, seed=0), offsets=rigged(6, seed=0).offsets[::-1])]
    object.__setattr__(clips[1], "weights", clips[0].weights[::-1])
    glb = written(clips if rig else [plain(clip) for clip in clips])
    assert len(glb.tree["animations"]) == 1
    assert [node["name"] for node in glb.tree["nodes"]] == ["face_1", "face_2"]
    assert glb.tree["scenes"][0]["nodes"] == [0, 1]
    x = [node["translation"][0] for node in glb.tree["nodes"]]
    assert x[1] - x[0] == pytest.approx(APART * np.ptp(clips[0].template[:, 0]))
    assert sum(x) == pytest.approx(0)
    for node, clip in enumerate(clips):
        there = clip.vertices + np.float32([x[node], 0, 0])
        assert np.abs(glb.positions(node) - there).max() < (1e-6 if rig else 1e-4)
    targets = [mesh["primitives"] for mesh in glb.tree["meshes"]]
    assert targets[0] == targets[1], "what the faces share is stored once"


def test_no_faces_no_file(tmp_path):
    with pytest.raises(NoFacesError, match=r"\.glb needs faces"):
        writers.save(changed(rigged(), faces=None), tmp_path / "talk.glb")
    assert list(tmp_path.iterdir()) == []


def test_triangles_without_area_and_loose_vertices_leave_a_valid_mesh():
    clip = rigged()
    faces = clip.faces[(clip.faces != 0).all(axis=1)]
    glb = written(changed(clip, faces=np.concatenate([faces, [[1, 1, 2]]]).astype(np.int32)))
    indices = glb.accessor(glb.mesh_of(0)["primitives"][0]["indices"])
    assert np.array_equal(indices.reshape(-1, 3), faces)
    assert glb.attribute(0, "NORMAL")[0].tolist() == [0, 0, 1]


def test_more_vertices_than_16_bits_count():
    template, faces = ball(300, 230)
    offsets = np.zeros((1, *template.shape), np.float32)
    offsets[0, -1] = 0.01
    codes = np.zeros((1, 1), np.int64)
    deltas = offsets.copy()
    clip = rigged(1)
    big = changed(clip, template=template, faces=faces, colours=None, rig=Rig(("jawOpen",), deltas))
    object.__setattr__(big, "weights", np.ones((1, 1), np.float32))
    glb = written(big)
    assert len(template) > 65_535
    assert np.array_equal(glb.positions(0)[0], template + offsets[0])
    assert np.array_equal(
        glb.accessor(glb.mesh_of(0)["primitives"][0]["indices"]).reshape(-1, 3), faces
    )
    still = Clip(offsets=offsets * 0, codes=codes, fps=30.0, template=template, faces=faces)
    assert np.array_equal(written(still).positions(0)[0], template)


@pytest.mark.parametrize("rig", [True, False])
def test_same_input_same_bytes(rig):
    clip = rigged(9) if rig else plain(rigged(9))
    first, again = (io.BytesIO() for _ in range(2))
    for file in (first, again):
        writers.write(clip, file, GLB)
    assert first.getvalue() == again.getvalue()
