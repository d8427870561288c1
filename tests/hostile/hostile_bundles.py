"""Bundles that somebody has tampered with: manifest, arrays, graphs, links."""

import functools
import hashlib
import io
import json
import shutil
from pathlib import Path

import numpy as np
import onnx
from hostile_bytes import (
    change_array,
    change_tree,
    change_zip,
    damaged,
    damaged_text,
    odd_value,
    pick,
)
from onnx import TensorProto, helper, numpy_helper

DATA = Path(__file__).parents[1] / "data"
SOURCES = (DATA / "tiny-bundle", DATA / "cdface-tiny/bundle", DATA / "tiny-faceformer")


@functools.cache
def seeds():
    """Whole bundles as {name: bytes}, with every optional field of a manifest in use."""
    return [_rich({f.name: f.read_bytes() for f in source.iterdir()}) for source in SOURCES]


def _rich(files):
    manifest = json.loads(files["manifest.json"])
    n = manifest["n_vertices"]
    template = np.load(io.BytesIO(files["template.npy"]))
    extra = {
        "colours.npy": np.zeros((n, 3), np.uint8),
        "region.npy": np.arange(5, dtype=np.int32),
        "identity.npy": template,
    }
    for name, array in extra.items():
        buffer = io.BytesIO()
        np.save(buffer, array)
        files[name] = buffer.getvalue()
    if manifest["rig"] is None:
        from facecode.clip import Rig
        from facecode.rig_file import write_rig

        deltas = np.random.default_rng(0).standard_normal((3, n, 3)).astype(np.float32)
        buffer = io.BytesIO()
        write_rig(Rig(("jawOpen", "a", "b"), deltas), buffer)
        files["rig.npz"] = buffer.getvalue()
        manifest["rig"] = {"names": ["jawOpen", "a", "b"], "deltas": "rig.npz"}
    manifest |= {"colours": "colours.npy", "regions": {"lips": "region.npy"}, "lip_pair": [0, 1]}
    manifest["identities"] = {"one": "identity.npy"}
    return files | {"manifest.json": _listing(manifest, files)}


def _listing(manifest, files):
    manifest["files"] = {
        name: {"size": len(data), "sha256": hashlib.sha256(data).hexdigest()}
        for name, data in files.items()
        if name != "manifest.json"
    }
    return json.dumps(manifest).encode()


def make(rng, folder):
    """Write a tampered bundle into `folder`; gives what was done, in a word."""
    files = dict(pick(rng, seeds()))
    manifest = json.loads(files["manifest.json"])
    what = pick(
        rng,
        (
            "manifest",
            "manifest",
            "manifest",
            "text",
            "array",
            "array",
            "graph",
            "graph",
            "bytes",
            "link",
            "exchange",
        ),
    )
    arrays = sorted(name for name in files if name.endswith(".npy"))
    graphs = sorted(name for name in files if name.endswith(".onnx"))
    if what == "manifest":
        for _ in range(int(pick(rng, (1, 1, 1, 2, 5)))):
            change_tree(rng, manifest)
        files["manifest.json"] = json.dumps(manifest).encode("utf-8", "surrogatepass")
    elif what == "text":
        files["manifest.json"] = damaged_text(rng, files["manifest.json"].decode())
    elif what == "array":
        name = pick(rng, [*arrays, "rig.npz"])
        files[name] = _array(rng, name, files[name])
    elif what == "graph":
        name = pick(rng, graphs)
        files[name] = change_graph(rng, files[name])
    elif what == "bytes":
        name = pick(rng, [*arrays, *graphs, "rig.npz"])
        files[name] = damaged(rng, files[name])
    elif what == "exchange":
        one, two = pick(rng, sorted(files)), pick(rng, sorted(files))
        files[one], files[two] = files[two], files[one]
        files["manifest.json"] = json.dumps(manifest).encode()
    if what in ("array", "graph", "bytes", "exchange") and rng.random() < 0.9:
        files["manifest.json"] = _listing(manifest, files)
    folder.mkdir()
    for name, data in files.items():
        (folder / name).write_bytes(data)
    if what == "link" or rng.random() < 0.02:
        _link(rng, folder, sorted(files))
    return what


def _array(rng, name, data):
    if name == "rig.npz":
        with np.load(io.BytesIO(data)) as rig:
            return change_zip(rng, dict(rig))
    return change_array(rng, np.load(io.BytesIO(data)))


def _link(rng, folder, names):
    """A file of the bundle as a link, to itself, outside, a device or a folder."""
    target = folder / pick(rng, names)
    target.unlink()
    where = pick(
        rng, ("", "../secret/secret.npy", "/dev/zero", "/dev/stdin", ".", "..", target.name, "none")
    )
    if where:
        target.symlink_to(where)
    else:
        target.mkdir()
        shutil.copy(folder / pick(rng, [n for n in names if n != target.name]), target)


def change_graph(rng, data):
    """Another graph: signature, operators, sizes, loops, external data."""
    model = onnx.load_from_string(data)
    for _ in range(int(pick(rng, (1, 1, 2, 3)))):
        pick(rng, CHANGES)(rng, model.graph)
    return model.SerializeToString()


def _rename(rng, graph):
    value = pick(rng, [*graph.input, *graph.output])
    value.name = pick(rng, ("x", "", "codes", "motion"))


def _retype(rng, graph):
    value = pick(rng, [*graph.input, *graph.output])
    value.type.tensor_type.elem_type = int(pick(rng, (0, 1, 6, 7, 8, 9, 10, 11, 16, 99)))


def _reshape(rng, graph):
    value = pick(rng, [*graph.input, *graph.output])
    dims = value.type.tensor_type.shape.dim
    if dims:
        pick(rng, list(dims)).dim_value = int(pick(rng, (0, 1, 3, 2**31, -1, 10**12)))


def _operator(rng, graph):
    node = pick(rng, list(graph.node))
    node.op_type = pick(
        rng, ("Unknown", "Loop", "If", "Scan", "Identity", "Relu", "MatMul", "", "Neg")
    )
    if rng.random() < 0.2:
        node.domain = pick(rng, ("com.microsoft", "ai.onnx.ml", "evil"))


def _wire(rng, graph):
    node = pick(rng, [n for n in graph.node if n.input])
    node.input[0] = pick(
        rng, ("", "none", node.output[0], graph.output[0].name, graph.input[0].name)
    )


def _drop(rng, graph):
    del graph.node[int(rng.integers(len(graph.node)))]


def _attribute(rng, graph):
    nodes = [n for n in graph.node if n.attribute]
    attribute = pick(rng, list(pick(rng, nodes).attribute))
    attribute.i = int(pick(rng, (-1, 0, 2**31, 2**62)))
    attribute.f = float("nan")
    if attribute.ints:
        attribute.ints[0] = int(pick(rng, (-1, 0, 2**40)))


def _weight(rng, graph):
    tensor = pick(rng, list(graph.initializer))
    array = numpy_helper.to_array(tensor)
    if rng.random() < 0.3:
        tensor.dims[:] = [int(pick(rng, (0, 2, -1, 2**40)))]
    elif array.dtype.kind == "f":
        tensor.CopyFrom(
            numpy_helper.from_array(
                np.full_like(array, pick(rng, (np.nan, np.inf, 1e38, 0))), tensor.name
            )
        )
    else:
        value = np.array(pick(rng, (-1, 0, 2**31 - 1)), np.int64).astype(array.dtype)
        tensor.CopyFrom(numpy_helper.from_array(np.full_like(array, value), tensor.name))


def _external(rng, graph):
    tensor = pick(rng, list(graph.initializer))
    tensor.data_location = TensorProto.EXTERNAL
    tensor.ClearField("raw_data")
    place = pick(
        rng,
        (
            "../secret/secret.npy",
            "/etc/passwd",
            "template.npy",
            "none",
            "/dev/zero",
            "a\0b",
            "./../secret/secret.npy",
            "manifest.json",
        ),
    )
    for key, value in (("location", place), ("offset", str(odd_value(rng))), ("length", "16")):
        if rng.random() < 0.8:
            tensor.external_data.add(key=key, value=value.encode("utf-8", "replace").decode())


def _giant(rng, graph):
    """A value of terabytes behind an output."""
    size = int(pick(rng, (10**9, 10**12, 2**62)))
    graph.initializer.append(helper.make_tensor("giant_shape", TensorProto.INT64, [1], [size]))
    graph.node.insert(0, helper.make_node("ConstantOfShape", ["giant_shape"], ["giant"]))
    graph.node.append(helper.make_node("ReduceSum", ["giant"], ["giant_sum"], keepdims=0))


def _loop(rng, graph):
    """A loop of 10^18 turns."""
    body = helper.make_graph(
        [helper.make_node("Identity", ["c"], ["c2"]), helper.make_node("Add", ["v", "v"], ["v2"])],
        "body",
        [helper.make_tensor_value_info(n, t, []) for n, t in (("i", 7), ("c", 9), ("v", 1))],
        [helper.make_tensor_value_info(n, t, []) for n, t in (("c2", 9), ("v2", 1))],
    )
    for name, kind, value in (("n", 7, 10**18), ("go", 9, True), ("v0", 1, 0.0)):
        graph.initializer.append(helper.make_tensor(f"loop_{name}", kind, [], [value]))
    node = helper.make_node("Loop", ["loop_n", "loop_go", "loop_v0"], ["loop_out"], body=body)
    graph.node.insert(0, node)


CHANGES = (
    _rename,
    _retype,
    _reshape,
    _operator,
    _wire,
    _drop,
    _attribute,
    _weight,
    _external,
    _giant,
    _loop,
)
