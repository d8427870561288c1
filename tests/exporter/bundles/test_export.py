"""init -> export -> verify through the command line, and what an export leaves behind."""

import json
from importlib.metadata import version

import numpy as np
import onnx
import pytest
import soundfile
from conftest import SPEECH, TINY

import facecode
from facecode_exporter.bundles import parity
from facecode_exporter.cli.main import main
from facecode_exporter.errors import ParityError
from facecode_spec.graphs import OPSET
from facecode_spec.manifest import ParityCase


@pytest.fixture(scope="module")
def checkpoints(tmp_path_factory):
    out = tmp_path_factory.mktemp("init") / "checkpoints"
    assert main(["init", "--system", "codetalker-tiny", "--out", str(out)]) == 0
    return ["--stage1", str(out / "stage1.pth.tar"), "--stage2", str(out / "stage2.pth.tar")]


@pytest.fixture(scope="module")
def exported(checkpoints, tmp_path_factory):
    out = tmp_path_factory.mktemp("export") / "bundle"
    args = ["export", "--system", "codetalker-tiny", *checkpoints, "--out", str(out)]
    assert main(args) == 0
    return out


def test_without_a_template_vertices_are_offsets(exported):
    face = facecode.load(exported)
    assert not face.manifest.has_template
    clip = face.animate(SPEECH)
    np.testing.assert_array_equal(clip.vertices, clip.offsets)
    assert clip.faces is None


def test_the_committed_tiny_bundle_is_what_the_script_makes(exported):
    """Same weights, same codes; the graph files may differ in the exporter's version."""
    ours, fresh = facecode.load(TINY).animate(SPEECH), facecode.load(exported).animate(SPEECH)
    np.testing.assert_array_equal(ours.codes, fresh.codes)
    np.testing.assert_allclose(ours.offsets, fresh.offsets, atol=1e-5)


def test_manifest(exported):
    manifest = json.loads((exported / "manifest.json").read_text())
    assert set(manifest["sources"]) == {"stage1", "stage2"}
    assert manifest["exported_with"]["torch"] == version("torch")
    assert manifest["opset"] == OPSET
    assert manifest["modes"]["exact"]["look_ahead_ms"] is None
    assert manifest["modes"]["window"]["delay_frames"] == 30
    assert set(manifest["files"]) == {
        f.name for f in exported.iterdir() if f.name != "manifest.json"
    }


@pytest.mark.parametrize(
    "name", ["speech_encoder", "decoder_step", "motion_decoder", "vertex_head"]
)
def test_graph_files(exported, name):
    content = (exported / f"{name}.onnx").read_bytes()
    for trace in (b"site-packages", b'.py"', b"stack_trace"):
        assert trace not in content
    model = onnx.load_from_string(content)
    assert [o.version for o in model.opset_import if not o.domain] == [OPSET]
    kinds = {node.op_type for node in model.graph.node}
    assert not kinds & {"BatchNormalization", "If", "Loop", "Dropout"}
    assert all(not t.external_data for t in model.graph.initializer)


def test_existing_bundle_is_replaced_and_other_folders_are_not(
    exported, checkpoints, tmp_path, capsys
):
    other = tmp_path / "photos"
    other.mkdir()
    (other / "cat.png").touch()
    args = ["export", "--system", "codetalker-tiny", *checkpoints, "--quiet", "--out"]
    assert main([*args, str(other)]) == 2
    assert "name a new or empty folder" in capsys.readouterr().err
    assert [f.name for f in other.iterdir()] == ["cat.png"]
    assert main([*args, str(tmp_path / "none" / "bundle")]) == 2
    assert [f.name for f in tmp_path.iterdir()] == ["photos"]
    (exported / "manifest.json").touch()
    before = (exported / "codebook.npy").stat().st_ino
    assert main([*args, str(exported)]) == 0
    assert (exported / "codebook.npy").stat().st_ino != before
    assert [f.name for f in exported.parent.iterdir()] == ["bundle"]


def test_a_failed_comparison_fails_the_export(checkpoints, tmp_path, monkeypatch, capsys):
    """A runtime that looks up the wrong rows: exit 1, the numbers, and no bundle."""
    from facecode.loop.part import Codebook

    right = Codebook.look_up
    monkeypatch.setattr(Codebook, "look_up", lambda self, codes: right(self, codes - 1))
    out = tmp_path / "bundle"
    args = ["export", "--system", "codetalker-tiny", *checkpoints, "--quiet", "--out", str(out)]
    assert main(args) == 1
    err = capsys.readouterr().err
    assert "codes equal, vertices within" in err
    assert not list(tmp_path.iterdir())


def test_verify(exported, checkpoints, tmp_path, capsys):
    assert main(["verify", str(exported), *checkpoints, "--quiet"]) == 0
    out = capsys.readouterr().out
    assert "decoder_step.features: within" in out
    assert "37 frames: 148 of 148 codes equal" in out
    samples, rate = soundfile.read(SPEECH)
    soundfile.write(tmp_path / "mine.ogg", np.repeat(samples[: 2 * rate, None], 2, 1), rate)
    args = ["verify", str(exported), *checkpoints, "--audio", str(tmp_path / "mine.ogg")]
    assert main([*args, "--style", "a:0.5,c:0.5"]) == 0
    assert "59 frames: 236 of 236 codes equal" in capsys.readouterr().out


def test_verify_finds_other_weights(exported, tmp_path, capsys):
    out = tmp_path / "other"
    assert main(["init", "--system", "codetalker-tiny", "--seed", "5", "--out", str(out)]) == 0
    args = ["--stage1", str(out / "stage1.pth.tar"), "--stage2", str(out / "stage2.pth.tar")]
    assert main(["verify", str(exported), *args, "--quiet"]) == 1
    assert "differs from torch" in capsys.readouterr().err


def test_parity_is_strict():
    good = ParityCase(3, 12, 12, 9e-5, 0.1)
    parity.require_parity([good])
    for bad in (
        ParityCase(3, 12, 11, 0.0, 0.1),
        ParityCase(3, 12, 12, 1.1e-4, 0.1),
        ParityCase(3, 12, 12, float("nan"), 0.1),
    ):
        with pytest.raises(ParityError, match="1 of 2 clips"):
            parity.require_parity([good, bad])


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--config", "none.yaml"], "cannot be read"),
        (["--system", "codetalker-tiny", "--template", "none.ply"], "no template file"),
    ],
)
def test_mistakes_exit_2(checkpoints, tmp_path, capsys, args, message):
    assert main(["export", *args, *checkpoints, "--out", str(tmp_path / "b")]) == 2
    err = capsys.readouterr().err
    assert message in err
    assert err.startswith("facecode-export: ")
    assert not list(tmp_path.iterdir())


def test_without_the_extra(monkeypatch, tmp_path, capsys):
    import builtins

    real = builtins.__import__

    def without_torch(name, *args, **kwargs):
        if name.partition(".")[0] == "torch":
            raise ModuleNotFoundError("No module named 'torch'", name="torch")
        return real(name, *args, **kwargs)

    monkeypatch.delitem(__import__("sys").modules, "facecode_exporter.random_weights")
    monkeypatch.setattr(builtins, "__import__", without_torch)
    assert main(["init", "--system", "codetalker-tiny", "--out", str(tmp_path / "x")]) == 2
    assert "pip install '.[export]'" in capsys.readouterr().err
