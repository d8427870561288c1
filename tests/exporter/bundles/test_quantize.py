"""int8 bundles: integer kernels in use, deviation measured, stated and gated."""

import json

import numpy as np
import onnx
import pytest
from onnx import helper, numpy_helper

import facecode
from facecode_exporter.bundles import deviation, quantize
from facecode_exporter.cli.main import main
from facecode_exporter.errors import DeviationError, IntegerKernelError
from facecode_spec.manifest import Deviation


@pytest.fixture(scope="module")
def checkpoints(tmp_path_factory):
    out = tmp_path_factory.mktemp("init") / "checkpoints"
    assert main(["init", "--system", "codetalker-tiny", "--out", str(out)]) == 0
    return ["--stage1", str(out / "stage1.pth.tar"), "--stage2", str(out / "stage2.pth.tar")]


def export(checkpoints, out, *more):
    args = ["export", "--system", "codetalker-tiny", *checkpoints, "--out", str(out), "--quiet"]
    return main([*args, "--precision", "int8", *more])


def test_int8_bundle(checkpoints, tmp_path, monkeypatch, capsys, caplog):
    monkeypatch.setattr(quantize, "SMALLEST_QUANTISED", 256)
    assert export(checkpoints, tmp_path / "b", "--any-deviation") == 0
    assert "int8 against float32: " in capsys.readouterr().out
    assert not caplog.records  # of a library
    manifest = json.loads((tmp_path / "b" / "manifest.json").read_text())
    assert manifest["precision"] == "int8"
    assert 0 < manifest["quantisation"]["code_agreement"] <= 1
    for name in ("speech_encoder", "decoder_step", "motion_decoder", "vertex_head"):
        graph = onnx.load(tmp_path / "b" / f"{name}.onnx").graph
        kinds = [node.op_type for node in graph.node]
        assert "MatMulInteger" in kinds
        assert "ConvInteger" not in kinds
    assert main(["verify", str(tmp_path / "b"), *checkpoints]) == 2
    assert "verify compares float32 bundles" in capsys.readouterr().err
    clip = facecode.load(tmp_path / "b", threads=1).animate(
        np.random.default_rng(0).standard_normal(16000).astype(np.float32) / 10
    )
    assert np.isfinite(clip.offsets).all()


def test_a_large_deviation_is_refused(checkpoints, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(quantize, "SMALLEST_QUANTISED", 256)
    monkeypatch.setattr(deviation, "LEAST_CODES", 1.1)
    assert export(checkpoints, tmp_path / "b") == 1
    assert "accept it with --any-deviation" in capsys.readouterr().err
    assert not (tmp_path / "b").exists()


@pytest.mark.parametrize(
    ("codes", "lips", "fits"),
    [(0.9, 0.001, True), (0.7, 0.001, False), (0.9, 0.02, False), (1.0, float("nan"), False)],
)
def test_gate(codes, lips, fits):
    found = Deviation(100, codes, lips)
    if fits:
        deviation.require_small(found)
    else:
        with pytest.raises(DeviationError, match="int8 against float32"):
            deviation.require_small(found)


def product(weight, turned):
    """x @ weight + 1 as one Gemm."""
    stored = weight.T.copy() if turned else weight
    node = helper.make_node("Gemm", ["x", "w", "b"], ["y"], name="gemm", transB=int(turned))
    graph = helper.make_graph(
        [node],
        "graph",
        [helper.make_tensor_value_info("x", 1, ["n", weight.shape[0]])],
        [helper.make_tensor_value_info("y", 1, ["n", weight.shape[1]])],
        [
            numpy_helper.from_array(stored, "w"),
            numpy_helper.from_array(np.ones(weight.shape[1], np.float32), "b"),
        ],
    )
    opset = helper.make_opsetid("", 20)
    return helper.make_model(graph, opset_imports=[opset], ir_version=10)


@pytest.mark.parametrize("turned", [False, True])
def test_a_gemm_is_quantised_per_channel(tmp_path, turned):
    import onnxruntime as ort

    from facecode.session import Compute, session_options

    rng = np.random.default_rng(0)
    weight = rng.standard_normal((96, 64)).astype(np.float32) * np.geomspace(1e-3, 10, 64)
    path = tmp_path / "graph.onnx"
    onnx.save(product(weight.astype(np.float32), turned), path)
    quantize.quantise_file(path)
    assert quantize.integer_products(path) == 1
    x = rng.standard_normal((5, 96)).astype(np.float32)
    options = session_options(Compute(threads=1))
    session = ort.InferenceSession(path, options, providers=["CPUExecutionProvider"])
    (got,) = session.run(None, {"x": x})
    want = x @ weight
    error = np.abs(got - 1 - want).max(axis=0) / np.abs(want).max(axis=0)
    assert error[np.abs(want).max(axis=0) > 0.1].max() < 0.03  # small channels have own scales


def test_products_that_would_stay_float_are_an_error(tmp_path, monkeypatch):
    path = tmp_path / "graph.onnx"
    onnx.save(product(np.ones((96, 64), np.float32), False), path)
    monkeypatch.setattr(quantize, "integer_products", lambda path: 0)
    with pytest.raises(IntegerKernelError, match="0 of the 1 int8 products"):
        quantize.quantise_file(path)


def test_kept_weights_and_small_ones_stay_float(tmp_path):
    path = tmp_path / "graph.onnx"
    onnx.save(product(np.eye(96, 64, dtype=np.float32), False), path)
    quantize.quantise_file(path, kept_float=("w",))
    assert quantize.integer_products(path) == 0
    onnx.save(product(np.eye(9, 9, dtype=np.float32), False), path)
    quantize.quantise_file(path)
    assert quantize.integer_products(path) == 0
