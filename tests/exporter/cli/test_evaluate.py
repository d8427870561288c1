"""`facecode-export evaluate` from folder to table and JSON."""

import json
import pickle
import shutil
import sys
from typing import NamedTuple

import numpy as np
import pytest
import soundfile
from conftest import SPEECH, TINY

import facecode
from facecode.errors import FacecodeError, MissingExtraError
from facecode_exporter.cli.main import main
from facecode_exporter.data import recordings
from facecode_exporter.evaluation import plots, reference, speech
from facecode_exporter.evaluation.reference import Reference

N_VERTICES = 42
TEXT = (
    "And mister John Dashwood had then leisure to consider how much there might be "
    "prudently in his power to do for them."
)


class Phone(NamedTuple):
    name: str
    start_s: float
    end_s: float


PHONES = [Phone("SIL", 0, 0.4), Phone("M", 0.4, 0.5), Phone("AA", 0.5, 0.9), Phone("SIL", 0.9, 1)]


class FakeAligner:
    def align(self, _audio, text):
        if "wrong" in text:
            raise FacecodeError("the words do not fit")
        return PHONES


@pytest.fixture
def region_args(tmp_path):
    (tmp_path / "lve.txt").write_text("0, 1, 2")
    (tmp_path / "fdd.txt").write_text("30, 31")
    return ["--lips", str(tmp_path / "lve.txt"), "--upper-face", str(tmp_path / "fdd.txt")]


@pytest.fixture
def data(tmp_path, tiny, speech_second):
    """One clip of style a and one of a stranger: the truth is what the bundle says in style a."""
    root = tmp_path / "data"
    (root / "vertices_npy").mkdir(parents=True)
    (root / "wav").mkdir()
    template = tiny.bundle.template
    templates = {"a": template, "stranger": template}
    (root / "templates.pkl").write_bytes(pickle.dumps(templates, 2))
    for name in ("a_s01", "stranger_s01"):
        shutil.copy(speech_second, root / "wav" / f"{name}.wav")
        truth = tiny.animate(speech_second, "a").vertices
        np.save(root / "vertices_npy" / f"{name}.npy", truth.reshape(len(truth), -1))
    return root


@pytest.fixture
def speech_second(tmp_path, speech):
    samples, rate = speech
    soundfile.write(tmp_path / "second.wav", samples[:rate], rate)
    return tmp_path / "second.wav"


@pytest.fixture
def recorded(tmp_path, speech_second, monkeypatch):
    monkeypatch.setattr(recordings, "load_aligner", FakeAligner)
    folder = tmp_path / "recorded"
    folder.mkdir()
    for name in ("one", "two"):
        shutil.copy(speech_second, folder / f"{name}.wav")
        (folder / f"{name}.txt").write_text("mama")
    return folder


def evaluate(capsys, *args):
    code = main(["evaluate", *map(str, args), "--quiet"])
    out, err = capsys.readouterr()
    return code, out, err


def test_a_bundle_against_its_own_motion(data, region_args, tmp_path, capsys):
    report = tmp_path / "report.json"
    args = [TINY, "--data", data, "--dataset", "plain", *region_args, "--json", report]
    code, out, err = evaluate(capsys, "bundle", *args)
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert [line.split()[0] for line in lines[1:]] == ["a", "b", "c", "all", "codes"]
    assert lines[1].split()[3:] == ["0.0000e+00", "0.0000e+00", "0.0000e+00"]
    numbers = json.loads(report.read_text())
    assert [(c["clip"], c["style"]) for c in numbers["clips"]] == [
        *(("a_s01", "a"), ("stranger_s01", "a"), ("stranger_s01", "b"), ("stranger_s01", "c"))
    ]
    assert numbers["pooled"]["a"]["lve"] == 0 < numbers["pooled"]["b"]["lve"]
    assert numbers["pooled"]["all"]["n_clips"] == 4
    assert numbers["split"] == "all"


def test_predictions_in_both_forms(data, region_args, tmp_path, tiny, speech_second, capsys):
    folder = tmp_path / "predictions"
    folder.mkdir()
    clip = tiny.animate(speech_second, "a")
    clip.save(folder / "a_s01.npz")
    longer = np.concatenate([clip.vertices, clip.vertices[:3]]) + np.float32([0, 0, 2])
    np.save(folder / "stranger_s01.npy", longer.reshape(len(longer), -1))
    args = [folder, "--data", data, "--dataset", "plain", *region_args, "--json", "-"]
    code, out, _ = evaluate(capsys, "predictions", *args)
    numbers = json.loads(out)
    assert code == 0
    same, moved = numbers["clips"]
    assert same["lve"] == same["mve"] == 0
    assert moved["lve"] == pytest.approx(4, rel=1e-4)  # 2 along z at every vertex
    assert moved["mve"] == pytest.approx(2, rel=1e-4)
    assert (moved["n_cut_prediction"], moved["n_cut_truth"]) == (3, 0)
    _, out, _ = evaluate(capsys, "predictions", *args[:-2])
    assert "not compared: 3 last frames of predictions, 0 of the truth" in out


def test_different_rates_are_refused(data, region_args, tmp_path, tiny, speech_second, capsys):
    folder = tmp_path / "predictions"
    folder.mkdir()
    clip = tiny.animate(speech_second, "a")
    for name in ("a_s01", "stranger_s01"):
        np.save(folder / f"{name}.npy", clip.vertices[::2])
    args = [folder, "--data", data, "--dataset", "plain", *region_args]
    code, _, err = evaluate(capsys, "predictions", *args)
    assert code == 2
    assert "15 frames predicted, 29 captured" in err
    code, _, err = evaluate(
        capsys, "bundle", TINY, "--data", data, "--dataset", "biwi", *region_args
    )
    assert code == 2
    assert "no clip of split 'test-a'" in err


def test_mistakes_are_one_line(data, region_args, recorded, tmp_path, capsys):
    (tmp_path / "fdd.txt").write_text("41, 42")
    bundle = ["bundle", TINY, "--data", data, "--dataset", "plain"]
    heard = ["speech", recorded, "--bundle", TINY, "--reference", "none"]
    pair = [*heard, "--lip-pair", "3,20"]
    for args, message in (
        (bundle, "the region lips is not known"),
        ([*bundle, *region_args], "names vertex 42; the mesh has 42"),
        ([*bundle, *region_args, "--styles", "a,x"], "got style x; this bundle has a, b, c"),
        ([*bundle, *region_args, "--json", tmp_path / "no" / "x.json"], "does not exist"),
        ([*bundle, *region_args, "--window", "3"], "a window goes with mode 'window'"),
        (heard, "names no lip pair; give --lip-pair"),
        ([*heard, "--lip-pair", "3,42"], "expected two vertices below 42"),
        ([*heard, "--lip-pair", "3,3"], "expected two vertices below 42"),
        ([*pair, "--plots", tmp_path / "no"], "does not exist"),
        ([*pair, "--reference", tmp_path / "no"], "is no folder"),
        ([*pair, "--reference", tmp_path], "has no one.npy or one.npz"),
        (["speech", tmp_path / "no", *pair[2:]], "is no folder"),
        (["speech", data, *pair[2:]], "holds no recording that can be used"),
    ):
        code, out, err = evaluate(capsys, *args)
        assert (code, out) == (2, ""), args
        assert message in err
        assert err.count("\n") == 1


def test_speech_with_plots(recorded, tmp_path, capsys):
    soundfile.write(recorded / "three.flac", np.ones(16000) / 9, 16000)
    shutil.copy(recorded / "one.wav", recorded / "four.wav")
    (recorded / "four.txt").write_text("wrong")
    args = [recorded, "--bundle", TINY, "--lip-pair", "3,20", "--reference", "none"]
    args += ["--styles", "a,c", "--json", tmp_path / "r.json", "--plots", tmp_path]
    code, out, err = evaluate(capsys, "speech", *args)
    assert code == 0
    assert "left out three.flac: there is no three.txt" in err
    assert "left out four.wav: the words do not fit" in err
    assert [line.split()[0] for line in out.splitlines()[1:]] == ["a", "c", "all"]
    numbers = json.loads((tmp_path / "r.json").read_text())
    assert numbers["pooled"]["all"]["closures"]["n"] == 4
    assert numbers["pooled"]["all"]["lag_frames"] is None
    assert numbers["clips"][0]["phones"]["closures"][0]["phone"] == "M"
    assert set(numbers["left_out"]) == {"three.flac", "four.wav"}
    for name in ("one_a", "one_c", "two_a", "two_c"):
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_a_reference_folder(recorded, tmp_path, tiny, capsys):
    """Compared with its own motion: no lag, full correlation, as many pops."""
    folder = tmp_path / "reference"
    folder.mkdir()
    for name in ("one", "two"):
        tiny.animate(recorded / f"{name}.wav", "b").save(folder / f"{name}.npz")
    args = [recorded, "--bundle", TINY, "--lip-pair", "3,20", "--reference", folder]
    _, out, _ = evaluate(capsys, "speech", *args, "--styles", "b", "--json", "-")
    pooled = json.loads(out)["pooled"]["all"]
    assert pooled["lag_frames"] == 0
    assert pooled["correlation"] == pytest.approx(1)
    assert pooled["face_pops"]["ratio"] == 1
    assert pooled["lip_pops"] == {"value": None, "ratio": None}  # this bundle names no lips


def test_a_bundle_without_a_template_is_refused(tmp_path, tiny_copy, capsys):
    manifest = tiny_copy / "manifest.json"
    manifest.write_text(json.dumps({**json.loads(manifest.read_text()), "has_template": False}))
    args = [tmp_path, "--bundle", tiny_copy, "--lip-pair", "3,20"]
    code, _, err = evaluate(capsys, "speech", *args)
    assert code == 2
    assert "export it again with --template" in err


def test_measures_of_one_animation():
    """A mouth that opens by 1 on AA alone, at 10 fps, on a square of four vertices."""
    template = np.array([[0, 1, 0], [0, 0, 0], [9, 0, 0], [0, 9, 0]], np.float32)
    offsets = np.zeros((10, 4, 3), np.float32)
    offsets[6:9, 0, 1] = 1
    clip = facecode.Animation(offsets, np.zeros((10, 1), np.int64), 10.0, template)
    recording = recordings.Recording("x", SPEECH, np.zeros(16000, np.float32), PHONES)
    same = Reference(offsets[:, 0, 1], clip.vertices)
    result = speech.measure(clip, recording, "a", (0, 1), np.array([0, 1]), same)
    assert [v.met for v in result.verdicts] == [True, True, True]
    assert result.face_pops.ratio == result.lip_pops.ratio == 1
    # Accelerations of +-100 at one of four vertices, or of two lip vertices.
    assert result.face_pops.value == pytest.approx(100 / np.sqrt(4))
    assert result.lip_pops.value == pytest.approx(100 / np.sqrt(2))
    plain = speech.measure(clip, recording, "a", (0, 1))
    assert (plain.correlations, plain.lip_pops, plain.face_pops.ratio) == (None, None, None)


def test_resampled_curves_keep_their_times():
    curve = np.arange(30, dtype=np.float32)  # value t at t / 30 s
    at_25 = reference.resampled(curve, 30.0, 25.0)
    np.testing.assert_allclose(at_25, np.arange(25) * 30 / 25, atol=1e-5)
    np.testing.assert_array_equal(reference.resampled(curve, 30.0, 30.0), curve)


def test_plots_name_their_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(MissingExtraError, match=r"pip install '\.\[plots\]'"):
        plots.require_matplotlib()


def test_real_alignment_and_the_rules(tmp_path, tiny):
    """The corpus's aligner and rules: the reference is near its own kind, whatever the bundle."""
    pytest.importorskip("pocketsphinx")
    pytest.importorskip("facecode_exporter.corpus.phones")
    shutil.copy(SPEECH, tmp_path / "speech.flac")
    (tmp_path / "speech.txt").write_text(TEXT)
    found, skipped = recordings.read_recordings(tmp_path, recordings.load_aligner())
    assert (len(found), skipped) == (1, [])
    rules = reference.from_rules(tiny)
    calm, lively = (rules(found[0], style) for style in ("calm", "lively"))
    assert calm.vertices is None  # of another mesh than the tiny bundle's
    assert len(calm.opening) == len(lively.opening) == 213
    assert np.corrcoef(calm.opening, lively.opening)[0, 1] > 0.9
