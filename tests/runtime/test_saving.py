"""What the command lines say of outputs beside their names: `--vrma` and `--onto`."""

import numpy as np
import pytest
from avatars import ARKIT, avatar, container
from conftest import SPEECH, TINY
from gltf_reading import Glb

import facecode
from facecode.cli import main
from facecode.writers.vrma import EXTENSION

PRESETS = ["aa", "ih", "ou", "ee", "oh", "blinkLeft", "blinkRight"]


@pytest.fixture(scope="module")
def clip():
    return facecode.load(threads=1).animate(SPEECH, mode="window")


@pytest.fixture
def saved(tmp_path, clip):
    clip.save(tmp_path / "talk.npz")
    return tmp_path / "talk.npz"


def expressions(path):
    return Glb(path.read_bytes()).tree["extensions"][EXTENSION]["expressions"]


def test_animate_and_convert_write_presets(tmp_path, saved):
    one, two, custom = (tmp_path / f"{name}.vrma" for name in ("one", "two", "custom"))
    animate = ["animate", str(SPEECH), "--mode", "window", "--quiet"]
    assert main([*animate, "-o", str(one), "--vrma", "presets"]) == 0
    convert = ["convert", str(saved), "--quiet"]
    assert main([*convert, "-o", str(two), "-o", str(tmp_path / "t.csv"), "--vrma", "presets"]) == 0
    assert main([*convert, "-o", str(custom), "--vrma", "custom"]) == 0
    for path in (one, two):
        assert list(expressions(path)) == ["preset"]
        assert list(expressions(path)["preset"]) == PRESETS
    assert list(expressions(custom)) == ["custom"]
    shapes = [Glb(path.read_bytes()).accessor(0).shape for path in (one, two)]
    assert shapes[0] == shapes[1]


def test_many_recordings_to_presets(tmp_path):
    out = tmp_path / "out"
    args = ["animate", str(SPEECH), "--out-dir", str(out), "--format", "vrma", "--quiet"]
    assert main([*args, "--mode", "window", "--vrma", "presets"]) == 0
    assert list(expressions(out / "speech.vrma")["preset"]) == PRESETS


def test_convert_onto_an_avatar(tmp_path, saved, clip, capsys):
    head, out = tmp_path / "head.glb", tmp_path / "out.glb"
    head.write_bytes(container(*avatar([("face", ARKIT)])))
    assert main(["convert", str(saved), "-o", str(out), "--onto", str(head)]) == 0
    assert "head.glb: 52 of 52 face units move it" in capsys.readouterr().out
    glb = Glb(out.read_bytes())
    sampler = glb.tree["animations"][-1]["samplers"][0]
    weights = glb.accessor(sampler["output"]).reshape(clip.n_frames, -1)
    assert weights.shape[1] >= 52
    jaw = clip.weights[:, clip.weight_names.index("jawOpen")]
    assert np.abs(weights[:, ARKIT.index("jawOpen")] - jaw).max() < 1e-4


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["-o", "talk.csv", "--vrma", "presets"], "give -o FILE.vrma"),
        (["-o", "talk.npz", "--onto", "head.glb"], "give -o FILE.glb"),
        (["-o", "talk.glb", "--onto", "none.glb"], "no avatar at none.glb"),
    ],
)
def test_what_does_not_go_together_is_refused_first(options, said, saved, monkeypatch, capsys):
    monkeypatch.chdir(saved.parent)
    for command in (["animate", str(SPEECH)], ["convert", str(saved)]):
        assert main([*command, *options]) == 2
        assert said in capsys.readouterr().err
    assert list(saved.parent.iterdir()) == [saved]


def test_an_avatar_that_does_not_fit_is_refused_before_the_work(tmp_path, monkeypatch, capsys):
    head = tmp_path / "head.glb"
    head.write_bytes(container(*avatar([("face", ["smirk", "grin"])])))
    monkeypatch.setattr(facecode.Animator, "animate", None)
    args = ["animate", str(SPEECH), "-o", str(tmp_path / "out.glb"), "--onto", str(head)]
    assert main(args) == 2
    assert "bears the name of a face unit" in capsys.readouterr().err
    assert main([*args, "--bundle", str(TINY)]) == 2
    assert "need face units" in capsys.readouterr().err
