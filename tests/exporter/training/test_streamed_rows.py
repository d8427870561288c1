"""What a decoder hears in training is what it hears live, to the bit."""

import dataclasses

import numpy as np
import pytest
import torch
import yaml
from conftest import DATA, make_folder

import facecode
from facecode.audio import SPEECH, load_audio
from facecode.live.memory import LiveMemory
from facecode.live.plan import Plan
from facecode_exporter.cli.main import main
from facecode_exporter.config import system_from_config
from facecode_exporter.data.data_set import LAYOUTS
from facecode_exporter.training.speech_rows import SpeechRows
from facecode_exporter.training.streamed_rows import random_plan, streamed_rows, whole_seconds
from facecode_spec.systems import SYSTEMS


@pytest.fixture(scope="module")
def encoder():
    return facecode.load(threads=1).engine.speech_encoder


def one_of(rows):
    """The first tensor that a decoder reads, frame by frame."""
    return next(iter(rows.values()))


def test_rows_are_those_of_a_stream(encoder):
    wave = load_audio(SPEECH, 16_000)
    before, spoken = wave[: 3 * 16_000], wave[3 * 16_000 : 3 * 16_000 + 37_123]
    for plan in (
        Plan(30.0, 16_000, look_ahead=6, block=3, context=30),
        Plan(30.0, 16_000, look_ahead=3, block=6, context=60),
    ):
        memory = LiveMemory(encoder, plan, before)
        n_primer = memory.n_frames
        for _ in memory.hear(spoken):
            pass
        memory.end()
        live = [one_of(memory.frame(step)) for step in range(n_primer, memory.n_frames)]
        found = streamed_rows(
            lambda pieces: [
                torch.from_numpy(one_of(encoder.memory(piece, None).rows)[0]) for piece in pieces
            ],
            spoken,
            before,
            plan,
            rows_per_frame=1,
            normalise=False,
        )
        assert np.array_equal(found.numpy(), np.concatenate(live))


def test_plans_are_drawn_from_the_number_of_the_clip():
    plans = [random_plan(30.0, 16_000, seed) for seed in range(40)]
    assert plans == [random_plan(30.0, 16_000, seed) for seed in range(40)]
    assert {plan.look_ahead for plan in plans} == {3, 6, 9, 12}
    assert {plan.context for plan in plans} == {30, 60}
    assert all(dataclasses.replace(p, fps=25.0).fps == 25 for p in plans)


def test_what_was_spoken_before_lasts_whole_seconds():
    assert len(whole_seconds(np.ones(16_000 * 9 + 5, np.float32), 16_000)) == 48_000
    assert len(whole_seconds(np.ones(20_000, np.float32), 16_000)) == 16_000
    assert len(whole_seconds(np.ones(500, np.float32), 16_000)) == 16_000


def options_of(kind, root):
    """(options of `train` that name a tiny system, its data, what it trains last)."""
    if kind == "cdface":
        n_vertices = SYSTEMS["cdface-tiny"].n_vertices
        lips = root / "lips.txt"
        lips.write_text(",".join(str(2 * i) for i in range(17)))
        options = ["--system", "cdface-tiny", "--lips", lips, "--lip-pair", "1,3", "--part", "lips"]
    else:
        case = DATA / f"{kind}-vocaset-tiny"
        config = yaml.safe_load((case / "config.yaml").read_text())
        section = config["DATA"] if kind == "codetalker" else config
        section["train_subjects"] = " ".join(LAYOUTS["vocaset"].seen)
        (root / "config.yaml").write_text(yaml.safe_dump(config))
        files = (root / "config.yaml", case / "wav2vec2.json")
        n_vertices = system_from_config(*files).n_vertices
        options = ["--config", files[0], "--wav2vec2-config", files[1]]
    return [*options, "--data", make_folder(root / "data", "vocaset", n_vertices)]


@pytest.mark.parametrize("kind", ["codetalker", "cdface", "faceformer"])
def test_every_stage_that_hears_speech_hears_streams(kind, tmp_path, monkeypatch, capsys):
    """As often as asked for, in training alone; none is the training without the option."""
    options = [*options_of(kind, tmp_path), "--epochs", "1", "--crop-frames", "9", "--quiet"]
    options.append("--random-speech-encoder")
    stage = "stage2" if kind == "codetalker" else kind

    def train(out, stage, *more):
        return main(["train", stage, *map(str, options), "--out", str(tmp_path / out), *more])

    if kind != "faceformer":
        assert train("prior", "stage1") == 0
        options += ["--stage1", tmp_path / "prior" / "stage1.pth.tar"]
    heard = []
    real = SpeechRows._encode_streamed

    def listen(self, split, index):
        heard.append((split, index))
        return real(self, split, index)

    monkeypatch.setattr(SpeechRows, "_encode_streamed", listen)
    for out, share in (("without", ()), ("none", ("--streamed-share", "0"))):
        assert train(out, stage, *share) == 0
    assert not heard
    assert train("all", stage, "--streamed-share", "1") == 0
    assert sorted(heard) == [("train", i) for i in range(6)]
    without, none, every = (
        torch.load(next(folder.glob("*.pth*")), weights_only=True)
        for folder in (tmp_path / name for name in ("without", "none", "all"))
    )
    without, none, every = (s.get("state_dict", s) for s in (without, none, every))
    assert all(torch.equal(none[name], value) for name, value in without.items())
    assert not all(torch.equal(every[name], value) for name, value in without.items())
    assert train("none", stage, "--streamed-share", "0.5") == 2
    assert "another configuration" in capsys.readouterr().err


def test_shares_that_are_none(tmp_path, capsys):
    options = ["--system", "cdface-tiny", "--data", str(tmp_path), "--out", str(tmp_path)]
    for text in ("1.5", "-1", "nan", "half"):
        with pytest.raises(SystemExit):
            main(["train", "cdface", *options, f"--streamed-share={text}"])
        assert "expected a share from 0 to 1" in capsys.readouterr().err
    assert main(["train", "stage1", *options, "--streamed-share", "0.5", "--quiet"]) == 2
    assert "stage 1 hears no speech" in capsys.readouterr().err
