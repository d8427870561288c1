"""A bundle that was damaged, moved or crafted is refused before any graph is loaded."""

import hashlib
import json
import shutil

import numpy as np
import pytest
from conftest import TINY

import facecode
from facecode import errors
from facecode.bundle import PACKAGED, Bundle
from facecode.cli.main import main
from facecode.external_data import external_files


def edit_manifest(bundle, change):
    file = bundle / "manifest.json"
    manifest = json.loads(file.read_text())
    change(manifest)
    file.write_text(json.dumps(manifest))


def relist(bundle, name):
    """Make the manifest agree with a file that was changed."""
    data = (bundle / name).read_bytes()

    def change(manifest):
        entry = {"size": len(data), "sha256": hashlib.sha256(data).hexdigest()}
        manifest["files"][name] = entry

    edit_manifest(bundle, change)


def test_open(tiny):
    assert tiny.bundle.template.shape == (42, 3)
    assert tiny.bundle.faces.shape == (80, 3)
    assert tiny.bundle.manifest.topology == hashlib.sha256(tiny.bundle.faces.tobytes()).hexdigest()


def test_no_bundle(tmp_path):
    with pytest.raises(errors.BundleNotFoundError, match="does not exist"):
        Bundle.open(tmp_path / "none")
    with pytest.raises(errors.BundleNotFoundError, match=r"has no manifest\.json"):
        Bundle.open(tmp_path)


@pytest.mark.parametrize("name", sorted(PACKAGED))
@pytest.mark.parametrize("what", ["folder", "results", "file", "web page", "link", "manifest/"])
def test_what_is_no_bundle_does_not_hide_a_packaged_one(tmp_path, monkeypatch, name, what):
    monkeypatch.chdir(tmp_path)
    here = tmp_path / name
    if what == "file":
        here.touch()
    elif what == "link":
        here.symlink_to("nowhere")
    else:
        here.mkdir()
    if what == "results":
        (here / "talk.npz").touch()
    elif what == "web page":
        (here / "manifest.json").write_text('{"name": "app", "manifest_version": 3}')
    elif what == "manifest/":
        (here / "manifest.json").mkdir()
    assert Bundle.open(name).root == PACKAGED[name]
    assert main(["info", name]) == 0


def test_a_bundle_of_ones_own_keeps_its_name(tmp_path, monkeypatch):
    shutil.copytree(TINY, tmp_path / "demo")
    monkeypatch.chdir(tmp_path)
    assert Bundle.open("demo").manifest.n_vertices == 42


@pytest.mark.parametrize("name", sorted(f.name for f in TINY.iterdir() if f.suffix != ".json"))
@pytest.mark.parametrize("damage", ["missing", "truncated", "altered"])
def test_damaged_file(tiny_copy, name, damage):
    file = tiny_copy / name
    data = bytearray(file.read_bytes())
    if damage == "missing":
        file.unlink()
    elif damage == "truncated":
        file.write_bytes(data[:-1])
    else:
        data[len(data) // 2] ^= 1
        file.write_bytes(data)
    error = errors.MissingFileError if damage == "missing" else errors.AlteredFileError
    with pytest.raises(error, match=name):
        Bundle.open(tiny_copy)


def test_newer_format(tiny_copy):
    edit_manifest(tiny_copy, lambda m: m.update(format_version=2))
    with pytest.raises(errors.NewerBundleError, match="Upgrade facecode"):
        Bundle.open(tiny_copy)


def test_broken_manifest(tiny_copy):
    (tiny_copy / "manifest.json").write_text("{")
    with pytest.raises(errors.ManifestError, match="not JSON"):
        Bundle.open(tiny_copy)
    (tiny_copy / "manifest.json").write_bytes(b"\xff\xfe")
    with pytest.raises(errors.ManifestError):
        Bundle.open(tiny_copy)


@pytest.mark.parametrize("path", ["../secret", "/etc/passwd", "a/../../b", "..\\x", "C:x", ""])
def test_paths_that_leave_the_bundle(tiny_copy, path):
    def change(manifest):
        manifest["files"][path] = manifest["files"]["faces.npy"]
        manifest["faces"] = path

    edit_manifest(tiny_copy, change)
    with pytest.raises(errors.UnsafePathError):
        Bundle.open(tiny_copy)


def test_links_to_the_same_files_are_followed(tiny_copy, tmp_path):
    """As caches of downloads and some installers lay files out."""
    store = tmp_path / "store"
    store.mkdir()
    for file in list(tiny_copy.iterdir()):
        file.rename(store / file.name)
        file.symlink_to(store / file.name)
    assert facecode.load(tiny_copy).manifest == facecode.load(TINY).manifest
    (store / "faces.npy").write_bytes((store / "faces.npy").read_bytes()[::-1])
    with pytest.raises(errors.AlteredFileError, match=r"faces\.npy has changed"):
        Bundle.open(tiny_copy)
    (store / "faces.npy").unlink()
    with pytest.raises(errors.MissingFileError):
        Bundle.open(tiny_copy)


@pytest.mark.parametrize("target", ["/dev/zero", "/", "faces.npy"])
def test_links_to_anything_else_are_refused(tiny_copy, target):
    (tiny_copy / "faces.npy").unlink()
    (tiny_copy / "faces.npy").symlink_to(target)
    with pytest.raises(errors.MissingFileError):
        Bundle.open(tiny_copy)


def test_linked_folders_are_refused(tiny_copy, tmp_path):
    (tmp_path / "away").mkdir()
    (tiny_copy / "faces.npy").rename(tmp_path / "away" / "faces.npy")
    (tiny_copy / "more").symlink_to(tmp_path / "away")

    def change(manifest):
        manifest["files"]["more/faces.npy"] = manifest["files"].pop("faces.npy")
        manifest["faces"] = "more/faces.npy"

    edit_manifest(tiny_copy, change)
    with pytest.raises(errors.UnsafePathError, match="link to a folder"):
        Bundle.open(tiny_copy)


def test_files_without_a_hash_are_refused(tiny_copy):
    edit_manifest(tiny_copy, lambda m: m["files"].pop("decoder_step.onnx"))
    with pytest.raises(errors.ManifestError, match=r"decoder_step\.onnx but lists no size"):
        Bundle.open(tiny_copy)


@pytest.mark.parametrize(
    ("name", "array"),
    [
        ("template.npy", np.zeros((41, 3), np.float32)),
        ("template.npy", np.zeros((42, 3), np.float64)),
        ("codebook.npy", np.zeros((32, 9), np.float32)),
        ("faces.npy", np.zeros((80, 4), np.int32)),
    ],
)
def test_arrays_of_another_shape(tiny_copy, name, array):
    np.save(tiny_copy / name, array)
    relist(tiny_copy, name)
    with pytest.raises(errors.ManifestError, match=name):
        facecode.load(tiny_copy)


def test_pickled_arrays_are_refused(tiny_copy):
    np.save(tiny_copy / "template.npy", np.array([object()]), allow_pickle=True)
    relist(tiny_copy, "template.npy")
    with pytest.raises(errors.ManifestError, match="not a numpy array"):
        Bundle.open(tiny_copy)


def externalise(file, location):
    """Point the first initializer of a graph to a file beside it."""
    import onnx

    model = onnx.load(file)
    tensor = next(t for t in model.graph.initializer if t.HasField("raw_data"))
    tensor.ClearField("raw_data")
    tensor.data_location = onnx.TensorProto.EXTERNAL
    entry = tensor.external_data.add()
    entry.key, entry.value = "location", location
    file.write_bytes(model.SerializeToString())


@pytest.mark.parametrize("location", ["weights.bin", "/etc/passwd", "../../x"])
def test_external_data_that_is_not_listed(tiny_copy, location):
    externalise(tiny_copy / "vertex_head.onnx", location)
    relist(tiny_copy, "vertex_head.onnx")
    assert external_files(tiny_copy / "vertex_head.onnx") == [location]
    with pytest.raises(errors.ExternalDataError, match="does not list"):
        Bundle.open(tiny_copy)


def test_external_data_in_a_node_attribute(tiny_copy):
    import onnx

    file = tiny_copy / "vertex_head.onnx"
    model = onnx.load(file)
    tensor = onnx.TensorProto(data_type=1, dims=[1], data_location=onnx.TensorProto.EXTERNAL)
    tensor.external_data.add(key="location", value="hidden.bin")
    model.graph.node.append(onnx.helper.make_node("Constant", [], ["unused"], value=tensor))
    file.write_bytes(model.SerializeToString())
    assert external_files(file) == ["hidden.bin"]


def test_graphs_of_ours_have_no_external_data():
    for graph in TINY.glob("*.onnx"):
        assert external_files(graph) == []


@pytest.mark.parametrize("content", [b"", b"\xff\xff\xff", b"not a graph at all", bytes(64)])
def test_not_a_graph(tiny_copy, content):
    (tiny_copy / "vertex_head.onnx").write_bytes(content)
    relist(tiny_copy, "vertex_head.onnx")
    with pytest.raises((errors.ManifestError, errors.GraphError), match="vertex_head"):
        facecode.load(tiny_copy)


def test_a_graph_with_another_signature(tiny_copy):
    (tiny_copy / "vertex_head.onnx").write_bytes((tiny_copy / "motion_decoder.onnx").read_bytes())
    relist(tiny_copy, "vertex_head.onnx")
    with pytest.raises(errors.GraphError, match="its manifest says"):
        facecode.load(tiny_copy)


def test_every_error_is_a_facecode_error_and_a_builtin():
    builtin = (ValueError, FileNotFoundError, RuntimeError, OSError, ImportError)
    leaves = [
        e for e in vars(errors).values()
        if isinstance(e, type) and issubclass(e, errors.FacecodeError) and not e.__subclasses__()
    ]  # fmt: skip
    assert len(leaves) > 15
    assert all(issubclass(e, builtin) for e in leaves)


@pytest.mark.parametrize("name", ["demo", "diverse"])
def test_a_packaged_card_may_be_edited(name):
    """What tells people about a model is no part of what runs."""
    assert "MODEL_CARD.md" not in Bundle.open(name).manifest.files
