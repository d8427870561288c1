"""Speech onto avatars of others: what is added, and that nothing else is touched."""

import base64
import contextlib
import copy
import io
import json
import os
import struct

import numpy as np
import pytest
from avatars import ARKIT, PLACES, Motion, avatar, container
from gltf_reading import Glb

from facecode.errors import AvatarNotFoundError, OntoError
from facecode.writers.onto import onto, splice

FACE = [*ARKIT[::-1], "Basis smile"]
TEETH = ["jaw_open", "Jaw_Left", "jaw_R"]


def put(path, motion=None):
    """The avatar with the motion, and the report."""
    file = io.BytesIO()
    report = onto(motion or Motion(), path, file)
    return Glb(file.getvalue()), report


def saved(tmp_path, data, name="my head.glb"):
    path = tmp_path / name
    path.write_bytes(data)
    return path


def without_ours(tree):
    """The JSON without what is added at the ends of four tables, and the length of the buffer."""
    left = copy.deepcopy(tree)
    animation = left["animations"].pop()
    accessors = {s[key] for s in animation["samplers"] for key in ("input", "output")}
    for table, gone in (("accessors", accessors), ("bufferViews", accessors)):
        assert len(left[table]) > len(gone)
        del left[table][-len(gone) :]
    if not left["animations"]:
        del left["animations"]
    left["buffers"][0]["byteLength"] = None
    return left


def test_all_meshes_move_and_all_else_stays(tmp_path):
    tree, binary = avatar(
        [("Face", FACE), ("Teeth", TEETH), ("Hat", []), ("Cape", ["wind"])],
        extras={"z": 1, "ü": [0.1, 1e-7, None, True], "a": "\ud800"},
        extensions={"MY_thing": {"node": 3}},
        extensionsUsed=["MY_thing"],
    )
    tree["meshes"][0]["weights"] = [0.25] * len(FACE)
    text = json.dumps(tree, ensure_ascii=True).encode()
    chunk = (b"ODD ", b"1234")
    path = saved(tmp_path, container(tree, binary, [chunk], text))
    before = Glb(path.read_bytes())
    glb, report = put(path)
    assert glb.binary[: len(before.binary)] == before.binary
    assert glb.further == [chunk]
    before.tree["buffers"][0]["byteLength"] = None
    assert json.dumps(without_ours(glb.tree)) == json.dumps(before.tree), "order and content"
    times, face = glb.weights(0)
    assert np.array_equal(times, np.float32(np.arange(5) / 30))
    assert np.array_equal(face[:, :52], Motion().weights[:, ::-1])
    assert (face[:, 52] == np.float32(0.25)).all()
    teeth = glb.weights(1)[1]
    for column, unit in enumerate(("jawOpen", "jawLeft", "jawRight")):
        assert np.array_equal(teeth[:, column], Motion().of(unit))
    assert {c["target"]["node"] for c in glb.tree["animations"][0]["channels"]} == {0, 1}
    assert (report.matched, report.unmatched) == (tuple(ARKIT), ())
    text = report.describe()
    assert "my head.glb: 52 of 52 face units move it" in text
    assert "Basis smile" in text
    assert "wind" in text


@pytest.mark.parametrize("place", PLACES[:-1])
def test_names_in_every_place(tmp_path, place):
    path = saved(tmp_path, container(*avatar([("Face", ["x", *TEETH])], place)))
    glb, report = put(path)
    assert report.matched == ("jawLeft", "jawOpen", "jawRight")
    assert np.array_equal(glb.weights(0)[1][:, 1], Motion().of("jawOpen"))
    assert len(report.unmatched) == 49
    assert "tongueOut" in report.describe()


def vrm_0(binds):
    groups = [{"name": name, "presetName": "unknown", "binds": b} for name, b in binds.items()]
    return {"VRM": {"blendShapeMaster": {"blendShapeGroups": groups}}}


def vrm_1(binds):
    return {"VRMC_vrm": {"expressions": {"preset": {}, "custom": binds}}}


VRMS = [
    vrm_0(
        {
            "JawOpen": [
                {"mesh": 0, "index": 1, "weight": 50},
                {"mesh": 1, "index": 0, "weight": 100},
            ],
            "Joy": [{"mesh": 0, "index": 0, "weight": 100}],
            "TongueOut": [{"mesh": -1, "index": 0, "weight": 100}, {"mesh": 0, "index": 9}],
        }
    ),
    vrm_1(
        {
            "jawOpen": {
                "morphTargetBinds": [
                    {"node": 0, "index": 1, "weight": 0.5},
                    {"node": 1, "index": 0, "weight": 1},
                ]
            },
            "tongueOut": {"morphTargetBinds": [{"node": 77, "index": 0, "weight": 1}, 3]},
            "happy": {},
        }
    ),
]


@pytest.mark.parametrize("vrm", VRMS)
def test_expressions_of_a_vrm_tell_what_names_do_not(tmp_path, vrm):
    tree, binary = avatar([("Face", ["a", "b"]), ("Teeth", ["c"])], "nowhere", extensions=vrm)
    glb, report = put(saved(tmp_path, container(tree, binary), "me.vrm"))
    assert report.matched == ("jawOpen",)
    assert np.array_equal(glb.weights(0)[1][:, 1], Motion().of("jawOpen") * np.float32(0.5))
    assert not glb.weights(0)[1][:, 0].any()
    assert np.array_equal(glb.weights(1)[1][:, 0], Motion().of("jawOpen"))
    assert "told by the avatar's expressions: jawOpen" in report.describe()
    assert glb.tree["extensions"] == vrm


def test_names_of_targets_come_before_expressions(tmp_path):
    binds = {"jawOpen": [{"mesh": 0, "index": 0, "weight": 100}]}
    tree, binary = avatar([("Face", ["Joy", "JawOpen"])], extensions=vrm_0(binds))
    glb, _ = put(saved(tmp_path, container(tree, binary)))
    assert not glb.weights(0)[1][:, 0].any()
    assert np.array_equal(glb.weights(0)[1][:, 1], Motion().of("jawOpen"))


def test_a_mesh_of_two_nodes_moves_on_both_and_keeps_each_ones_rest(tmp_path):
    tree, binary = avatar([("Face", ["jawOpen", "fat"])])
    tree["nodes"].append({"mesh": 0, "weights": [0, 1]})
    glb, report = put(saved(tmp_path, container(tree, binary)))
    assert glb.weights(0)[1][:, 1].tolist() == [0] * 5
    assert glb.weights(1)[1][:, 1].tolist() == [1] * 5
    assert report.meshes[0].nodes == ("Face node", "node 1")


def test_an_earlier_animation_is_kept_and_ours_has_a_free_name(tmp_path):
    path = saved(tmp_path, container(*avatar([("Face", TEETH)])))
    first, _ = put(path)
    again = saved(tmp_path, container(first.tree, first.binary), "again.glb")
    second, report = put(again, Motion(3))
    assert [each["name"] for each in second.tree["animations"]] == ["facecode", "facecode 2"]
    assert np.array_equal(second.weights(0, 0)[1], first.weights(0)[1])
    assert len(second.weights(0, 1)[0]) == 3
    assert report.kept == ("facecode",)
    assert "'facecode 2'" in report.describe()


def test_it_can_replace_its_own_source(tmp_path):
    from facecode.writers import writing

    path = saved(tmp_path, container(*avatar([("Face", TEETH)])))
    with writing(path) as file:
        onto(Motion(), path, file)
    assert len(Glb(path.read_bytes()).weights(0)[0]) == 5


def split(tree, binary):
    """The same with a second buffer of its own, the third in the list, from view 3 on."""
    tree = copy.deepcopy(tree)
    cut = tree["bufferViews"][3]["byteOffset"]
    for view in tree["bufferViews"][3:]:
        view |= {"buffer": 2, "byteOffset": view["byteOffset"] - cut}
    return tree, binary[:cut], binary[cut:]


def test_a_gltf_comes_back_as_one_glb(tmp_path):
    whole, binary = avatar([("Face", TEETH)])
    tree, one, two = split(whole, binary)
    two += b"\0" * 5  # a file may be longer than is stated
    tree["bufferViews"].append({"buffer": 1, "byteLength": 8, "byteOffset": 4})
    compressed = {"buffer": 2, "byteOffset": 4, "byteLength": 8}
    tree["bufferViews"][-1]["extensions"] = {"EXT_meshopt_compression": dict(compressed)}
    tree["buffers"] = [
        {"byteLength": len(one), "uri": "data:application/octet-stream;base64,"},
        {"byteLength": 99, "extensions": {"EXT_meshopt_compression": {"fallback": True}}},
        {"byteLength": len(two) - 5, "uri": "parts/o%20ne.bin", "name": "teeth"},
    ]
    tree["buffers"][0]["uri"] += base64.b64encode(one).decode()
    tree["images"] = [{"uri": "skin.PNG", "name": "skin"}, {"uri": "data:image/png;base64,AAAA"}]
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "o ne.bin").write_bytes(two)
    (tmp_path / "skin.PNG").write_bytes(b"an image")
    glb, report = put(saved(tmp_path, json.dumps(tree).encode(), "face.gltf"))
    assert len(glb.tree["buffers"]) == 2
    assert glb.tree["buffers"][1] == tree["buffers"][1]
    assert "uri" not in glb.tree["buffers"][0]
    view = glb.tree["bufferViews"][len(tree["bufferViews"]) - 1]
    start = -(-len(one) // 4) * 4
    assert (view["buffer"], view["byteOffset"]) == (1, 4)
    moved = {**compressed, "buffer": 0, "byteOffset": start + 4}
    assert view["extensions"]["EXT_meshopt_compression"] == moved
    assert glb.tree["images"][1] == tree["images"][1]
    image = glb.tree["images"][0]
    assert image == {"name": "skin", "mimeType": "image/png", "bufferView": image["bufferView"]}
    assert glb.view(image["bufferView"]) == b"an image"
    original = Glb(container(whole, binary))
    for index in range(len(whole["accessors"])):
        assert np.array_equal(glb.accessor(index), original.accessor(index))
    assert f"bytes {start} to {start + len(two) - 5} of the first buffer" in report.describe()
    assert "skin.PNG" in report.describe()


def test_a_glb_whose_images_lie_beside_it(tmp_path):
    tree, binary = avatar([("Face", TEETH)], images=[{"uri": "a.jpg"}])
    (tmp_path / "a.jpg").write_bytes(b"12345")
    path = saved(tmp_path, container(tree, binary))
    glb, _ = put(path)
    assert glb.binary.startswith(binary)
    assert glb.view(glb.tree["images"][0]["bufferView"]) == b"12345"


def test_none_matched_names_what_was_found(tmp_path):
    path = saved(tmp_path, container(*avatar([("Face", ["Fcl_MTH_A", "Joy"])])))
    with pytest.raises(OntoError, match=r"browDownLeft.*Fcl_MTH_A.*Joy"):
        put(path)
    path = saved(tmp_path, container(*avatar([("Face", [])])))
    with pytest.raises(OntoError, match="no morph targets"):
        put(path)
    path = saved(tmp_path, container(*avatar([("Face", ["x"])], "nowhere")))
    with pytest.raises(OntoError, match="none has a name"):
        put(path)
    path = saved(tmp_path, container(*avatar([("", ["jawOpen"])])))
    with pytest.raises(OntoError, match="no node"):
        put(path)


TREE, BINARY = avatar([("Face", TEETH)])
GOOD = container(TREE, BINARY)


def with_tree(**changes):
    return container({**TREE, **changes}, BINARY)


def beside(uri, length=None):
    length = len(BINARY) if length is None else length
    return json.dumps({**TREE, "buffers": [{"uri": uri, "byteLength": length}]}).encode()


def deep(levels):
    return b'{"asset":{"version":"2.0"},"extras":' + b"[" * levels + b"]" * levels + b"}"


BROKEN = {
    "empty": (b"", "cannot be read"),
    "not JSON": (b"hello", "cannot be read"),
    "not UTF-8": (b"\xff\xfe{}", "cannot be read"),
    "a list": (b"[1]", "no glTF 2.0"),
    "no asset": (b"{}", "asset.version is None"),
    "glTF 1": (container({"asset": {"version": "1.0"}}), "asset.version is '1.0'"),
    "container 1": (b"glTF" + struct.pack("<II", 1, 12), "glTF 1"),
    "header": (GOOD[:11], "truncated: 11 bytes"),
    "truncated": (GOOD[:-8], "truncated: it states"),
    "cut in JSON": (b"glTF" + struct.pack("<II", 2, 100) + GOOD[12:100], "chunk at byte 12 states"),
    "no chunk": (b"glTF" + struct.pack("<II", 2, 12), "no chunk at byte 12"),
    "huge chunk": (GOOD[:12] + struct.pack("<I", 2**32 - 1) + GOOD[16:], "states 4294967295 bytes"),
    "other chunk": (GOOD[:16] + b"BIN\0" + GOOD[20:], "first chunk is not JSON"),
    "huge length": (GOOD[:8] + struct.pack("<I", 2**32 - 1) + GOOD[12:], "truncated"),
    "NaN": (container({}, text=b'{"asset":{"version":"2.0","x":NaN}}'), "NaN is no number"),
    "1e999": (container({}, text=b'{"asset":{"version":"2.0","x":-1e999}}'), "no number"),
    "deep": (deep(200_000), "cannot be read"),
    "short binary": (with_tree(buffers=[{"byteLength": 2**40}]), "binary chunk is truncated"),
    "negative length": (with_tree(buffers=[{"byteLength": -4}]), "byteLength of buffer 0 is -4"),
    "text length": (with_tree(buffers=[{"byteLength": "4"}]), "byteLength of buffer 0 is '4'"),
    "meshes": (with_tree(meshes={"a": 1}), "'meshes' is"),
    "a mesh": (with_tree(meshes=[3]), "'meshes' is"),
    "primitives": (with_tree(meshes=[{"primitives": 1}]), "'primitives' is 1"),
    "negative mesh": (with_tree(nodes=[{"mesh": -1}]), "mesh of node 0 is -1"),
    "false mesh": (with_tree(nodes=[{"mesh": False}]), "mesh of node 0 is False"),
    "mesh too far": (with_tree(nodes=[{"mesh": 1}]), "mesh of node 0 is 1; there are 1"),
    "accessor": (
        with_tree(meshes=[{"primitives": [{"targets": [{"POSITION": -1}]}]}]),
        "POSITION is -1",
    ),
    "many targets": (
        with_tree(meshes=[{"primitives": [{"targets": [{}] * 5000}]}]),
        "5000 morph targets",
    ),
    "animations": (with_tree(animations=[{"channels": 1}]), "'channels' is 1"),
    "no file": (beside("gone.bin"), "missing"),
    "above": (beside("../secret.bin"), "outside"),
    "above, escaped": (beside("%2e%2e/secret.bin"), "outside"),
    "above, within": (beside("a/../../secret.bin"), "outside"),
    "absolute": (beside("/etc/passwd", 5), "outside"),
    "backslash": (beside("..\\secret.bin"), "outside"),
    "drive": (beside("C:\\secret.bin"), "outside"),
    "file:": (beside("file:///etc/passwd", 5), "outside"),
    "http": (beside("http://example.com/a.bin"), "outside"),
    "empty uri": (beside(""), "outside"),
    "NUL": (beside("a%00.bin"), "outside"),
    "long name": (beside("a" * 5000), "cannot be read"),
    "a folder": (beside("folder"), "missing"),
    "a link": (beside("link.bin"), "outside"),
    "links in a circle": (beside("circle/a.bin"), "cannot be read|missing"),
    "short file": (beside("short.bin"), "truncated"),
    "number": (beside(3), "uri of buffer 0 is 3"),
    "not base64": (beside("data:;base64,@@@"), "cannot be decoded"),
    "no base64": (beside("data:text/plain,abc"), "cannot be decoded"),
    "short data": (beside("data:;base64,AAAA"), "truncated"),
    "image": (with_tree(images=[{"uri": "../secret.png"}]), "outside"),
    "image of no type": (with_tree(images=[{"uri": "short.bin"}]), "expected one of"),
    "outside and inside": (
        with_tree(buffers=[{"byteLength": 4, "uri": "short.bin"}]),
        "has a binary chunk",
    ),
    "views": (
        json.dumps(
            {
                **TREE,
                "buffers": [{"byteLength": 3}, {"byteLength": 4, "uri": "short.bin"}],
                "bufferViews": [{"buffer": -1}],
            }
        ).encode(),
        "buffer of a buffer view is -1",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_and_hostile_files_give_one_clear_error(tmp_path, case):
    folder = tmp_path / "avatar"
    (folder / "folder").mkdir(parents=True)
    (tmp_path / "secret.bin").write_bytes(BINARY)
    (tmp_path / "secret.png").write_bytes(b"x")
    (folder / "short.bin").write_bytes(b"1234")
    (folder / "link.bin").symlink_to(tmp_path / "secret.bin")
    (folder / "circle").symlink_to(folder / "circle")
    data, message = BROKEN[case]
    file = io.BytesIO()
    with pytest.raises(OntoError, match=message) as caught:
        onto(Motion(), saved(folder, data), file)
    assert len(str(caught.value)) < 400
    assert "\n" not in str(caught.value)
    assert file.getvalue() == b""


def test_no_avatar(tmp_path):
    with pytest.raises(AvatarNotFoundError, match="no avatar at"):
        put(tmp_path / "none.glb")
    with pytest.raises(OntoError, match="is no file"):
        put(tmp_path)
    os.mkfifo(tmp_path / "pipe.glb")
    with pytest.raises(OntoError, match="is no file"):
        put(tmp_path / "pipe.glb")


def test_a_file_that_shrinks_while_it_is_copied(tmp_path, monkeypatch):
    path = saved(tmp_path, GOOD)
    gather = splice.gather

    def cut(source):
        found = gather(source)
        os.truncate(path, len(GOOD) - 40)
        return found

    monkeypatch.setattr(splice, "gather", cut)
    with pytest.raises(OntoError, match=r"^/.*ended 40 bytes early"):
        put(path)


def test_json_without_bound_is_refused_unread(tmp_path):
    path = tmp_path / "huge.gltf"
    path.touch()
    os.truncate(path, 1 << 40)  # a hole: it takes no room
    with pytest.raises(OntoError, match="MiB of JSON"):
        put(path)


def test_odd_animations_of_others_are_kept(tmp_path):
    odd = [{"name": "", "channels": [{"target": {"node": [1], "path": "weights"}}, {}]}]
    glb, report = put(saved(tmp_path, with_tree(animations=odd)))
    assert glb.tree["animations"][:1] == odd
    assert report.kept == ()


def test_an_animation_without_bound_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(splice, "MOST_BYTES", 50)
    with pytest.raises(OntoError, match="would take"):
        put(saved(tmp_path, GOOD))


def test_random_damage_never_gives_another_error(tmp_path):
    rng = np.random.default_rng(0)
    for _ in range(300):
        data = bytearray(GOOD)
        for _ in range(rng.integers(1, 4)):
            data[rng.integers(0, 20 + len(json.dumps(TREE)))] = rng.integers(0, 256)
        with contextlib.suppress(OntoError):
            onto(Motion(), saved(tmp_path, bytes(data)), io.BytesIO())


def test_onto_on_the_command_line(tmp_path, capsys):
    from conftest import SPEECH, TINY

    from facecode.cli import main

    out = str(tmp_path / "talk.npz")
    assert main(["animate", str(SPEECH), "-o", out, "--onto", "head.glb"]) == 2
    assert "give -o FILE.glb" in capsys.readouterr().err
    out = str(tmp_path / "talk.glb")
    args = ["animate", str(SPEECH), "-o", out, "--onto", str(tmp_path / "none.glb"), "--quiet"]
    assert main([*args, "--bundle", str(TINY)]) == 2
    assert "need face units" in capsys.readouterr().err
    assert main([*args, "--mode", "window"]) == 2
    assert "no avatar at" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
