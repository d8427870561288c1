"""Heads as .glb in Khronos' validator, three.js and Blender: valid, and every vertex in place."""

import dataclasses
import io
import json
import time

import numpy as np
import pytest
from avatars import ARKIT, Motion, avatar, container
from gltf_clients import (
    HERE,
    bpy_python,
    facecap,
    far,
    in_blender,
    in_blender_script,
    in_chromium,
    in_three,
    longer,
    node_modules,
    run,
    sentence,
    validated,
)
from gltf_reading import Glb
from small_faces import changed, rigged

from facecode import writers
from facecode.writers.onto import onto

pytestmark = pytest.mark.clients

SEVERITIES = ("numErrors", "numWarnings", "numInfos", "numHints")
MEAN_MM, GREATEST_MM = 0.02, 0.6
LARGEST, LONGEST_S = 1_100_000, 0.3


def plain(clip):
    return dataclasses.replace(clip, rig=None)


SMALL = {
    "rig": rigged(),
    "25 fps": rigged(fps=25.0),
    "one frame": rigged(1),
    "one frame, no rig": changed(rigged(1), rig=None),
    "no rig": changed(rigged(40), rig=None),
    "no colours": rigged(colours=None),
    "z up, centimetres": rigged(up_axis="z", metres_per_unit=0.01),
    "unknown unit": changed(rigged(up_axis=None, metres_per_unit=None), rig=None),
    "takes": [rigged(seed=0), rigged(seed=0), rigged(seed=0)],
    "takes, no rig": [changed(rigged(seed=k), rig=None) for k in range(3)],
    "loose vertices": changed(rigged(), faces=rigged().faces[5:]),
}


def test_every_kind_of_file_is_valid(tmp_path):
    for name, clips in SMALL.items():
        writers.save(clips, tmp_path / f"{name}.glb")
    for report in validated(*sorted(tmp_path.glob("*.glb"))):
        assert [report[severity] for severity in SEVERITIES] == [0] * 4, report


def test_the_validator_finds_what_is_wrong(tmp_path):
    file = io.BytesIO()
    writers.write(rigged(), file, writers.FORMATS[".glb"])
    path = tmp_path / "wrong.glb"
    path.write_bytes(file.getvalue().replace(b'"scene":0', b'"scene":9'))
    assert validated(path)[0]["numErrors"] == 1


@pytest.mark.parametrize("seconds", [None, 60])
@pytest.mark.parametrize("rig", [True, False])
def test_the_packaged_sentence(tmp_path, rig, seconds):
    node_modules(), bpy_python()
    clip = sentence() if seconds is None else longer(sentence(), seconds)
    clip = clip if rig else plain(clip)
    path = tmp_path / "talk.glb"
    if rig:
        assert len(clip.weights) == clip.n_frames  # solved before the clock starts
    begun = time.perf_counter()
    writers.save(clip, path)
    took, size = time.perf_counter() - begun, path.stat().st_size
    report = validated(path)[0]
    assert [report[severity] for severity in SEVERITIES] == [0] * 4, report
    frames = [0, 50, 100, 101, clip.n_frames - 1]
    three, shown = in_three(path, [frame / clip.fps for frame in frames])
    wanted = clip.vertices
    three_mm = far(shown, wanted[frames])
    blender, shown = in_blender(path, clip.fps, clip.n_frames)
    blender_mm = far(shown, wanted)
    print(
        f"\n{clip.n_frames} frames, rig {rig}: {size} bytes, {took:.2f} s; mean, greatest mm: "
        f"three.js {three_mm} ({three['ms']} ms), Blender {blender_mm} (import "
        f"{blender['import_s']} s, all frames {blender['step_s']} s)"
    )
    for mean, greatest in (three_mm, blender_mm):
        assert mean <= MEAN_MM
        assert greatest <= GREATEST_MM
    if seconds is None and rig:
        assert size <= LARGEST
        assert took <= LONGEST_S
    assert three["animations"] == blender["actions"] == ["facecode"]
    assert three["meshes"][0]["targets"] == blender["keys"][0]
    assert three["meshes"][0]["colours"]
    assert blender["colours"] == [1]
    if rig:
        assert blender["keys"][0] == list(ARKIT)


def test_takes_in_a_row(tmp_path):
    clips = [rigged(6, seed=0) for _ in range(2)]
    object.__setattr__(clips[1], "weights", clips[0].weights[::-1])
    path = tmp_path / "takes.glb"
    writers.save(clips, path)
    glb = Glb(path.read_bytes())
    wanted = np.concatenate([glb.positions(0), glb.positions(1)], axis=1)
    three, shown = in_three(path, [frame / 30 for frame in range(6)])
    assert [mesh["name"] for mesh in three["meshes"]] == ["face_1", "face_2"]
    assert far(shown, wanted)[1] < 1e-3
    _, shown = in_blender(path, 30, 6)
    assert far(shown, wanted)[1] < 1e-3


def put(path, motion, to):
    with to.open("wb") as file:
        return onto(motion, path, file)


def findings(report):
    return {(each["code"], each["pointer"]) for each in report["messages"]}


AVATARS = {
    "two meshes": avatar([("Face", ARKIT), ("Teeth", ["jaw_open", "Jaw_L"])]),
    "VRM": avatar(
        [("Face", ["a", "b"])],
        "nowhere",
        extensionsUsed=["VRM"],
        extensions={
            "VRM": {
                "blendShapeMaster": {
                    "blendShapeGroups": [
                        {"name": "JawOpen", "binds": [{"mesh": 0, "index": 1, "weight": 100}]}
                    ]
                }
            }
        },
    ),
}


@pytest.mark.parametrize("name", AVATARS)
def test_an_avatar_is_as_valid_as_before(tmp_path, name):
    source, path = tmp_path / "me.glb", tmp_path / "talk.glb"
    source.write_bytes(container(*AVATARS[name]))
    put(source, Motion(9), path)
    before, after = validated(source, path)
    assert findings(after) == findings(before)
    assert after["numErrors"] == 0
    glb = Glb(path.read_bytes())
    nodes = range(len(glb.tree["nodes"]))
    wanted = np.concatenate([glb.positions(node) for node in nodes], axis=1)
    for _, shown in (in_three(path, [frame / 30 for frame in range(9)]), in_blender(path, 30, 9)):
        assert far(shown, wanted)[1] < 1e-2


def test_a_gltf_with_files_beside_it_is_valid(tmp_path):
    tree, binary = avatar([("Face", ARKIT)])
    (tmp_path / "face.bin").write_bytes(binary)
    buffers = [{"byteLength": len(binary), "uri": "face.bin"}]
    (tmp_path / "face.gltf").write_text(json.dumps({**tree, "buffers": buffers}))
    put(tmp_path / "face.gltf", Motion(9), tmp_path / "talk.glb")
    report = validated(tmp_path / "talk.glb")[0]
    assert [report[severity] for severity in SEVERITIES] == [0] * 4, report


def test_a_foreign_head_under_meshopt_compression(tmp_path):
    source, path = facecap(), tmp_path / "talk.glb"
    report = put(source, Motion(213), path)
    assert report.matched == tuple(ARKIT)
    print(f"\n{report.describe()}")
    before, after = validated(source, path)
    assert findings(after) == findings(before)
    assert after["numErrors"] == 0
    old, new = source.read_bytes(), path.read_bytes()
    n_json = int.from_bytes(old[12:16], "little")
    binary = old[20 + n_json + 8 :]
    start = 20 + int.from_bytes(new[12:16], "little") + 8
    assert new[start : start + len(binary)] == binary


PLAY_FACECODE = """
import bpy
keys = bpy.context.object.data.shape_keys
keys.animation_data.action = bpy.data.actions["facecode"]
"""


def test_a_foreign_head_in_blender(tmp_path):
    """Without its compression, which Blender 5.0 does not read; every key of every frame."""
    bpy_python()
    plain, path, motion = tmp_path / "plain.glb", tmp_path / "talk.glb", Motion(60)
    run("node", HERE / "unpack_meshopt.mjs", node_modules(), facecap(), plain)
    report = put(plain, motion, path)
    assert report.matched == tuple(ARKIT)
    facts, values, vertices = in_blender_script(path, PLAY_FACECODE, motion, tmp_path)
    assert len(facts["keys"]) == len(ARKIT)
    (mesh,) = (each for each in report.meshes if each.matched)
    for unit, targets in mesh.matched.items():
        for target in targets:
            assert np.abs(values[target] - motion.of(unit)).max() <= 1e-6
    assert np.ptp(vertices, axis=0).max() > 0.05  # it does move


def test_a_foreign_head_in_a_browser(tmp_path):
    path = tmp_path / "talk.glb"
    put(facecap(), Motion(60), path)
    pictures = [tmp_path / f"{time}.png" for time in (0.0, 1.0)]
    for picture in pictures:
        facts = in_chromium(path, picture, picture.stem)
        assert facts["errors"] == []
        assert facts["animations"][-1] == "facecode"
    assert pictures[0].read_bytes() != pictures[1].read_bytes()
