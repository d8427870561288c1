"""torch.onnx.export, driven by the graph signatures of facecode_spec.

Comes in: a view and its GraphSpec. Goes out: one self-contained .onnx file whose inputs, outputs
and axis names are those of the spec, and whose samples fixed no length.
"""

from __future__ import annotations

import contextlib
import io
import logging
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import onnx
import torch
from torch import Tensor, nn

from facecode_spec.graphs import OPSET, GraphSpec, TensorSpec

DTYPES = {"float32": torch.float32, "int64": torch.int64}
SAMPLE_SIZES = {
    "batch": 2,
    "n_samples": 5000,
    "n_past": 5,
    "n_slots": 9,
    "n_new": 6,
    "n_context": 2,
    "n_known": 4,
    "n_revisited": 7,
    "n_kept": 8,
    "n_shown": 3,
}
"""Sizes of the traced sample; none is 1, which torch.export would take for a constant."""

SMALLEST_HALVED = 1024
"""Weights below this many numbers stay as they are: nothing would be gained."""


def export_graph(view: nn.Module, spec: GraphSpec, path: Path) -> None:
    """Write `view` to `path` as ONNX."""
    samples = tuple(_sample(tensor) for tensor in spec.inputs)
    dims = dict.fromkeys(SAMPLE_SIZES, torch.export.Dim.DYNAMIC)
    shapes = tuple(
        {i: dims[axis] for i, axis in enumerate(tensor.axes) if isinstance(axis, str)}
        for tensor in spec.inputs
    )
    with torch.no_grad(), _quiet():
        program = torch.onnx.export(
            view.eval(),
            samples,
            dynamo=True,
            opset_version=OPSET,
            input_names=[t.name for t in spec.inputs],
            output_names=[t.name for t in spec.outputs],
            dynamic_shapes=_as_arguments(view, shapes),
            verbose=False,
        )
    assert program is not None
    model = program.model_proto
    _name_axes(model.graph, spec)
    _strip_traces(model)
    store_exact_halves(model.graph)
    onnx.checker.check_model(model)
    path.write_bytes(model.SerializeToString())


def _sample(tensor: TensorSpec) -> Tensor:
    shape = [SAMPLE_SIZES[a] if isinstance(a, str) else a for a in tensor.axes]
    if tensor.dtype == "int64":
        return torch.tensor(0) if not shape else torch.arange(*shape)
    return torch.rand(shape, dtype=DTYPES[tensor.dtype]) - 0.5


def _as_arguments(view: nn.Module, shapes: tuple[object, ...]) -> tuple[object, ...]:
    """Group the shapes as `forward` takes them: a `*state` parameter is one nested tuple."""
    code = view.forward.__code__
    has_star = bool(code.co_flags & 0x04)
    n_named = code.co_argcount - 1
    return (*shapes[:n_named], shapes[n_named:]) if has_star else shapes


def _name_axes(graph: onnx.GraphProto, spec: GraphSpec) -> None:
    """Write the spec's axis names into the graph's inputs and outputs."""
    for values, tensors in ((graph.input, spec.inputs), (graph.output, spec.outputs)):
        assert [v.name for v in values] == [t.name for t in tensors]
        for value, tensor in zip(values, tensors, strict=True):
            shape = value.type.tensor_type.shape
            assert len(shape.dim) == len(tensor.axes), (value.name, tensor.axes)
            for dim, axis in zip(shape.dim, tensor.axes, strict=True):
                if isinstance(axis, str):
                    dim.dim_param = axis
                else:
                    assert dim.dim_value in (axis, 0), (value.name, axis)
                    dim.dim_value = axis


def _strip_traces(model: onnx.ModelProto) -> None:
    """Remove the exporter's notes: stack traces with the paths of this machine, traced shapes."""
    graph = model.graph
    for item in (model, graph, *graph.node, *graph.input, *graph.output, *graph.initializer):
        item.ClearField("metadata_props")
        item.ClearField("doc_string")
    graph.ClearField("value_info")


def store_exact_halves(graph: onnx.GraphProto) -> None:
    """Store weights that float16 holds exactly as float16 with a Cast, at half the size.

    Lossless, and free at run time: onnxruntime folds the Cast when it loads the graph.
    """
    casts = []
    for tensor in graph.initializer:
        if tensor.data_type != onnx.TensorProto.FLOAT:
            continue
        weights = onnx.numpy_helper.to_array(tensor)
        if weights.size < SMALLEST_HALVED:
            continue
        with np.errstate(over="ignore"):
            halves = weights.astype(np.float16)
        if not np.array_equal(halves.astype(np.float32), weights):
            continue
        name = tensor.name
        tensor.CopyFrom(onnx.numpy_helper.from_array(halves, f"{name}.half"))
        casts.append(
            onnx.helper.make_node("Cast", [f"{name}.half"], [name], to=onnx.TensorProto.FLOAT)
        )
    nodes = [*casts, *graph.node]
    graph.ClearField("node")
    graph.node.extend(nodes)


def restore_halves(graph: onnx.GraphProto) -> None:
    """Undo `store_exact_halves`: weights as float32, without their Casts."""
    halves = {t.name: t for t in graph.initializer if t.data_type == onnx.TensorProto.FLOAT16}
    nodes = []
    for node in graph.node:
        if node.op_type == "Cast" and node.input[0] in halves:
            tensor = halves[node.input[0]]
            weights = onnx.numpy_helper.to_array(tensor).astype(np.float32)
            tensor.CopyFrom(onnx.numpy_helper.from_array(weights, node.output[0]))
        else:
            nodes.append(node)
    graph.ClearField("node")
    graph.node.extend(nodes)


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Hold back the exporter's progress lines and its notes about optional packages."""
    logger = logging.getLogger("torch.onnx")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)
