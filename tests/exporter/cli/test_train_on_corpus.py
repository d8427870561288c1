"""Both stages, and the network without a codebook, on a corpus of a few seconds."""

import json

import numpy as np
import pytest
import soundfile
import torch
from conftest import SPEECH

from facecode.audio import load_audio
from facecode_exporter.checkpoints import load_system
from facecode_exporter.cli.main import main
from facecode_exporter.head.head import PACKAGED
from facecode_exporter.nets.codetalker import CodeTalker
from facecode_spec.systems.codetalker_demo import SPEC


@pytest.fixture
def corpus(tmp_path):
    folder = tmp_path / "corpus"
    for kind in ("wav", "weights"):
        (folder / kind).mkdir(parents=True)
    speech, rng = load_audio(SPEECH, 16_000), np.random.default_rng(0)
    names = [f"{style}_{i:05d}" for i, style in enumerate(SPEC.styles)]
    for i, name in enumerate(names):
        n_frames = 20 + i
        np.save(folder / "weights" / f"{name}.npy", rng.random((n_frames, 52)).astype(np.float16))
        audio = speech[8000 * i :][: n_frames * 16_000 // 30]
        soundfile.write(folder / "wav" / f"{name}.flac", audio, 16_000)
    (folder / "head.npz").write_bytes(PACKAGED.read_bytes())
    splits = {"train": names[:6], "val": names[6:7], "test": names[7:]}
    (folder / "splits.json").write_text(json.dumps(splits))
    return folder


@pytest.fixture
def wheel(monkeypatch):
    """Random weights in place of the wheel's; reading it is tested elsewhere."""
    torch.manual_seed(1)
    weights = CodeTalker(SPEC).audio_encoder.state_dict()
    for module in ("model", "baseline"):
        monkeypatch.setattr(f"facecode_exporter.demo.{module}.whisper_weights", lambda _: weights)
    return weights


def train(*args):
    return main(
        ["train", *map(str, args), "--system", "codetalker-demo", "--epochs", "1", "--quiet"]
    )


def test_train_on_a_corpus(corpus, wheel, tmp_path, capsys):
    prior, speech = tmp_path / "prior", tmp_path / "speech"
    assert train("stage1", "--data", corpus, "--out", prior) == 0
    stage1 = prior / "stage1.pth.tar"
    options = ("--stage1", stage1, "--speech-encoder", "the.whl", "--out", speech)
    assert train("stage2", "--data", corpus, *options) == 0
    assert capsys.readouterr().out.split() == [str(stage1), str(speech / "stage2.pth.tar")]
    net = load_system(SPEC, [speech / "stage1.pth.tar"], [speech / "stage2.pth.tar"])
    name, kept = next(iter(wheel.items()))
    assert torch.equal(net.audio_encoder.state_dict()[name], kept.half().float())


def test_stage_2_says_what_it_needs(corpus, tmp_path, capsys):
    assert train("stage2", "--data", corpus, "--out", tmp_path / "speech") == 2
    assert "--speech-encoder, the wheel" in capsys.readouterr().err


def test_the_network_without_a_codebook_is_trained_and_scored(corpus, wheel, tmp_path, capsys):
    args = ["demo-baseline", "--corpus", corpus, "--whisper-wheel", "the.whl", "--work", tmp_path]
    assert main([*map(str, args), "--epochs", "1", "--quiet"]) == 0
    head, *_, numbers = capsys.readouterr().out.splitlines()
    assert "FDD" in head
    assert numbers.split()[:3] == ["all", "2", "55"]
