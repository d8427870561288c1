"""Graphs with int8 weights: products with constant weights, everything else float32.

Weights are signed and symmetric, one scale per output channel; activations are unsigned, one scale
per call, chosen while running. onnxruntime turns each product into one DynamicQuantizeMatMul.
Signed weights have the fastest kernel where the processor multiplies u8 by s8 without saturating
(VNNI, AMX, ARM dot product). Elsewhere the runtime asks onnxruntime for a slower product that is
right, so the range of the weights need not be reduced (`facecode.session`).
"""

from __future__ import annotations

import contextlib
import logging
import math
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import onnx
import onnxruntime as ort
from onnx import TensorProto
from onnxruntime.quantization import QuantType, quantize_dynamic

from facecode.session import Compute, session_options
from facecode_exporter.bundles.onnx_export import restore_halves, store_exact_halves
from facecode_exporter.errors import IntegerKernelError

INTEGER_OPERATORS = frozenset(("DynamicQuantizeMatMul", "MatMulIntegerToFloat", "MatMulInteger"))
SMALLEST_QUANTISED = 1 << 12
"""Weights below this many numbers stay float32: nothing would be gained."""


def quantise_file(path: Path, kept_float: Sequence[str] = ()) -> None:
    """Replace a float32 graph file by its int8 form.

    Args:
        path: a file that `export_graph` wrote.
        kept_float: parts of names of weights that stay float32.

    Raises:
        IntegerKernelError: onnxruntime would not run every quantised product on integers.
    """
    model = onnx.load(path)
    restore_halves(model.graph)
    _split_gemms(model.graph)
    _split_weights(model.graph)
    weights = {t.name: t for t in model.graph.initializer}
    left_out = [
        node.name
        for node in model.graph.node
        if node.op_type == "MatMul" and not _gains(weights.get(node.input[1]), kept_float)
    ]
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        source, target = Path(folder) / "float.onnx", Path(folder) / "int8.onnx"
        onnx.save(model, source)
        with _without_advice():
            quantize_dynamic(
                source,
                target,
                op_types_to_quantize=["MatMul"],
                per_channel=True,
                weight_type=QuantType.QInt8,
                nodes_to_exclude=left_out,
                extra_options={"MatMulConstBOnly": True, "DefaultTensorType": TensorProto.FLOAT},
            )
        result = onnx.load(target)
    result.ClearField("metadata_props")
    result.graph.ClearField("value_info")
    store_exact_halves(result.graph)
    path.write_bytes(result.SerializeToString())
    expected = sum(node.op_type == "MatMulInteger" for node in result.graph.node)
    found = integer_products(path)
    if found != expected:
        raise IntegerKernelError(
            f"onnxruntime runs {found} of the {expected} int8 products of {path.name} on integers; "
            "export float32, or try another release of onnxruntime"
        )


def _gains(weight: TensorProto | None, kept_float: Sequence[str]) -> bool:
    """Whether a product with `weight` is worth quantising; None: not a constant."""
    return (
        weight is not None
        and weight.data_type == TensorProto.FLOAT
        and math.prod(weight.dims) >= SMALLEST_QUANTISED
        and not any(part in weight.name for part in kept_float)
    )


def _split_gemms(graph: onnx.GraphProto) -> None:
    """Write each Gemm with a constant weight as a product and a sum, so that it is found."""
    weights = {t.name: t for t in graph.initializer}
    nodes = []
    for node in graph.node:
        if node.op_type != "Gemm" or node.input[1] not in weights:
            nodes.append(node)
            continue
        settings = {a.name: onnx.helper.get_attribute_value(a) for a in node.attribute}
        assert settings.get("alpha", 1) == settings.get("beta", 1) == 1, node.name
        assert not settings.get("transA", 0), node.name
        weight = weights[node.input[1]]
        if settings.get("transB", 0):
            turned = onnx.numpy_helper.to_array(weight).T.copy()
            weight.CopyFrom(onnx.numpy_helper.from_array(turned, weight.name))
        has_bias = len(node.input) > 2
        product = f"{node.output[0]}.product" if has_bias else node.output[0]
        nodes.append(
            onnx.helper.make_node("MatMul", node.input[:2], [product], name=f"{node.name}.product")
        )
        if has_bias:
            nodes.append(
                onnx.helper.make_node(
                    "Add", [product, node.input[2]], node.output, name=f"{node.name}.sum"
                )
            )
    graph.ClearField("node")
    graph.node.extend(nodes)


def _split_weights(graph: onnx.GraphProto) -> None:
    """Give each product a weight of its own: equal layers, as fresh ones are, share theirs.

    onnxruntime changes the sign of weights for some processors, and fails at the second time.
    """
    weights = {t.name: t for t in graph.initializer}
    taken = set()
    for node in graph.node:
        if node.op_type != "MatMul" or node.input[1] not in weights:
            continue
        if node.input[1] in taken:
            own = graph.initializer.add()
            own.CopyFrom(weights[node.input[1]])
            own.name = f"{node.name}.weight"
            node.input[1] = own.name
        taken.add(node.input[1])


def integer_products(path: Path) -> int:
    """How many products onnxruntime runs on integers when it has loaded the graph file."""
    with tempfile.TemporaryDirectory() as folder:
        optimised = Path(folder) / "optimised.onnx"
        options = session_options(Compute(threads=1))
        options.optimized_model_filepath = str(optimised)
        ort.InferenceSession(path, options, providers=["CPUExecutionProvider"])
        nodes = onnx.load(optimised, load_external_data=False).graph.node
    return sum(node.op_type in INTEGER_OPERATORS for node in nodes)


@contextlib.contextmanager
def _without_advice() -> Iterator[None]:
    """onnxruntime logs, for every graph, that it might be simplified first; these are."""
    logging.disable(logging.WARNING)
    try:
        yield
    finally:
        logging.disable(logging.NOTSET)
