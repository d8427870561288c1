"""Both stages on tiny folders in the public layouts, from the command line to a bundle."""

import csv
import dataclasses
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import torch
import yaml
from conftest import DATA, FORMS, SPEECH, make_folder

import facecode
from facecode_exporter.cli.main import main
from facecode_exporter.config import system_from_config
from facecode_exporter.data.clips import FolderClips, batches
from facecode_exporter.data.data_set import LAYOUTS
from facecode_exporter.errors import ConfigError, DataSetError
from facecode_exporter.training import run
from facecode_exporter.training.losses import straight_through
from facecode_spec.systems import SYSTEMS


@pytest.fixture(scope="module", params=FORMS)
def data(request, tmp_path_factory):
    """(folder, options that name the small system)."""
    form = request.param
    case = DATA / f"codetalker-{form}-tiny"
    root = tmp_path_factory.mktemp(form)
    config = yaml.safe_load((case / "config.yaml").read_text())
    config["DATA"]["train_subjects"] = " ".join(LAYOUTS[form].seen)
    (root / "config.yaml").write_text(yaml.safe_dump(config))
    options = [
        "--config",
        str(root / "config.yaml"),
        "--wav2vec2-config",
        str(case / "wav2vec2.json"),
    ]
    system = system_from_config(root / "config.yaml", case / "wav2vec2.json")
    make_folder(root / "data", form, system.n_vertices)
    return root / "data", options, system


def train(data, out, stage, *more):
    folder, options, _ = data
    args = ["train", stage, "--data", str(folder), *options, "--out", str(out), "--quiet"]
    if "--speech-encoder" not in more:
        args.append("--random-speech-encoder")
    return main([*args, *more])


def test_random_convolutions_are_learned_through_only_when_asked_for(data, tmp_path, capsys):
    folder, options, _ = data
    for stage in ("stage2", "faceformer"):
        args = ["train", stage, "--data", str(folder), *options, "--out", str(tmp_path / "run")]
        assert main([*args, "--stage1", "none.tar"]) == 2
        assert not (tmp_path / "run").exists()
    assert "--random-speech-encoder to go on without" in capsys.readouterr().err


def test_another_stage1_or_speech_encoder_is_another_run(data, tmp_path, capsys):
    short = ("--epochs", "1", "--crop-frames", "8")
    priors = []
    for seed in ("0", "1"):
        assert train(data, tmp_path / seed, "stage1", *short, "--seed", seed) == 0
        priors.append(str(tmp_path / seed / "stage1.pth.tar"))
    run = tmp_path / "run"
    assert train(data, run, "stage2", "--stage1", priors[0], *short) == 0
    before = (run / "stage2.pth.tar").read_bytes()
    assert train(data, run, "stage2", "--stage1", priors[0], *short) == 0
    assert train(data, run, "stage2", "--stage1", priors[1], *short) == 2
    assert "began with other weights" in capsys.readouterr().err
    assert (run / "stage2.pth.tar").read_bytes() == before


def test_layouts(data):
    folder, _, system = data
    form = "biwi" if system.fps == 25 else "vocaset"
    train_clips, val_clips = (FolderClips(folder, form, s, system) for s in ("train", "validation"))
    assert len(train_clips.names) == (6 if form == "vocaset" else 12)
    assert not set(train_clips.names) & set(val_clips.names)
    assert train_clips.offsets(0).shape == (21, 3 * system.n_vertices)
    assert abs(train_clips.offsets(0)).max() <= 0.2001
    styles = {train_clips.style(i) for i in range(len(train_clips.names))}
    assert styles == set(range(2 if form == "vocaset" else 6))
    assert train_clips.audio(0).dtype == np.float32


def test_both_stages_then_export_and_animate(data, tmp_path, capsys):
    assert train(data, tmp_path / "one", "stage1", "--epochs", "3") == 0
    stage1 = tmp_path / "one" / "stage1.pth.tar"
    assert capsys.readouterr().out.strip() == str(stage1)
    more = ["--epochs", "2", "--batch-size", "2", "--crop-frames", "15"]
    assert train(data, tmp_path / "two", "stage2", "--stage1", str(stage1), *more) == 0
    stage2 = tmp_path / "two" / "stage2.pth.tar"
    with (tmp_path / "one" / "losses.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["epoch"] for row in rows] == ["1", "2", "3"]
    assert float(rows[-1]["train_reconstruction"]) < float(rows[0]["train_reconstruction"])
    assert json.loads((tmp_path / "two" / "config.json").read_text())["crop_frames"] == 15
    checkpoints = ["--stage1", str(stage1), "--stage2", str(stage2), "--quiet"]
    bundle = tmp_path / "bundle"
    assert main(["export", *data[1], *checkpoints, "--out", str(bundle)]) == 0
    assert len(facecode.load(bundle).animate(SPEECH).codes) > 100


@pytest.mark.parametrize("stage", ["stage1", "stage2"])
def test_interrupted_and_resumed_is_uninterrupted(data, tmp_path, monkeypatch, stage):
    more = ["--epochs", "3"]
    if stage == "stage2":
        assert train(data, tmp_path / "prior", "stage1", "--epochs", "1") == 0
        more += ["--stage1", str(tmp_path / "prior" / "stage1.pth.tar")]
    assert train(data, tmp_path / "whole", stage, *more) == 0
    real, calls = run._epoch, []

    def interrupted(*args, **kwargs):
        calls.append(1)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return real(*args, **kwargs)

    with monkeypatch.context() as patch:
        patch.setattr(run, "_epoch", interrupted)
        assert train(data, tmp_path / "cut", stage, *more) == 130
    assert not (tmp_path / "cut" / f"{stage}.pth.tar").exists()
    assert train(data, tmp_path / "cut", stage, *more) == 0
    whole, cut = (
        torch.load(tmp_path / n / f"{stage}.pth.tar", weights_only=True)["state_dict"]
        for n in ("whole", "cut")
    )
    for name, value in whole.items():
        assert torch.equal(cut[name], value), name
    curves = [(tmp_path / n / "losses.csv").read_text() for n in ("whole", "cut")]
    assert curves[0] == curves[1]


def test_another_configuration_is_refused(data, tmp_path, capsys):
    assert train(data, tmp_path / "run", "stage1", "--epochs", "1") == 0
    assert train(data, tmp_path / "run", "stage1", "--epochs", "1", "--seed", "7") == 2
    assert "another configuration" in capsys.readouterr().err


def test_pretrained_speech_encoder(data, tmp_path, capsys):
    from transformers import Wav2Vec2Config, Wav2Vec2Model

    system = data[2]
    config = Wav2Vec2Config(**system.speech_encoder.architecture)
    source = Wav2Vec2Model(config)
    source.save_pretrained(tmp_path / "hf")
    assert train(data, tmp_path / "one", "stage1", "--epochs", "1") == 0
    stage1 = str(tmp_path / "one" / "stage1.pth.tar")
    more = ["--epochs", "1", "--learning-rate", "1e-12", "--stage1", stage1]
    out = tmp_path / "two"
    assert train(data, out, "stage2", *more, "--speech-encoder", str(tmp_path / "hf")) == 0
    state = torch.load(out / "stage2.pth.tar", weights_only=True)["state_dict"]
    for name, value in source.state_dict().items():
        if "pos_conv" not in name and name != "masked_spec_embed":
            torch.testing.assert_close(state[f"audio_encoder.{name}"], value, rtol=0, atol=1e-6)
    capsys.readouterr()
    assert train(data, tmp_path / "x", "stage2", *more, "--speech-encoder", str(tmp_path)) == 2
    assert "no Hugging Face folder" in capsys.readouterr().err


def test_gradient_passes_the_quantiser():
    features = torch.randn(3, 4, requires_grad=True)
    vectors = torch.randn(3, 4)
    out = straight_through(features, vectors)
    torch.testing.assert_close(out, vectors)
    (out * 2).sum().backward()
    torch.testing.assert_close(features.grad, torch.full((3, 4), 2.0))


def test_batches_cover_every_clip_once():
    lengths = [5, 9, 7, 30, 12]
    epoch = batches(lengths, 2, 8, np.random.default_rng(0))
    seen = [i for batch in epoch for i, _, _ in batch]
    assert sorted(seen) == [0, 1, 2, 3, 4]
    for batch in epoch:
        assert len({n for _, _, n in batch}) == 1
        assert all(start + n <= lengths[i] and n <= 8 for i, start, n in batch)


def test_folders_that_are_none(tmp_path):
    def of(form, n_vertices):
        system = SYSTEMS[f"codetalker-{form}"]
        part = dataclasses.replace(system.parts[0], n_vertices=None)
        return dataclasses.replace(system, n_vertices=n_vertices, parts=(part,))

    with pytest.raises(DataSetError, match="has no folder vertices_npy"):
        FolderClips(tmp_path, "biwi", "train", of("biwi", 5))
    make_folder(tmp_path / "d", "vocaset", 5)
    with pytest.raises(DataSetError, match="this system has 6"):
        FolderClips(tmp_path / "d", "vocaset", "train", of("vocaset", 6)).offsets(0)
    with pytest.raises(DataSetError, match="no clip of split"):
        FolderClips(tmp_path / "d", "biwi", "train", of("biwi", 5))


@pytest.mark.parametrize("as_list", [False, True])
@pytest.mark.parametrize("choose", [lambda s: s[::-1], lambda s: s[1:], lambda s: s])
def test_styles_are_the_subjects_of_the_configuration(data, tmp_path, choose, as_list):
    """In their order, whatever the published one is, and those alone."""
    folder, options, published = data
    form = "biwi" if published.fps == 25 else "vocaset"
    config = yaml.safe_load(Path(options[1]).read_text())
    names = list(choose(published.styles[: 2 if form == "vocaset" else None]))
    config["DATA"]["train_subjects"] = names if as_list else " ".join(names)
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config))
    system = system_from_config(tmp_path / "config.yaml", Path(options[3]))
    assert system.styles == tuple(names)
    clips = FolderClips(folder, form, "train", system)
    found = {clip.rpartition("_")[0]: clips.style(i) for i, clip in enumerate(clips.names)}
    with_clips = {name.rpartition("_")[0] for name in clips.names}
    assert found == {name: names.index(name) for name in names if name in with_clips}
    assert with_clips


@pytest.mark.parametrize("given", [None, [], ["a", "a"], ["a", 1], 3, ""])
def test_subjects_that_are_no_names(data, tmp_path, given):
    _, options, _ = data
    config = yaml.safe_load(Path(options[1]).read_text())
    config["DATA"]["train_subjects"] = given
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config))
    with pytest.raises(ConfigError, match="train_subjects is"):
        system_from_config(tmp_path / "config.yaml", Path(options[3]))


def test_a_missing_recording_costs_its_clip_alone(data, tmp_path, capsys):
    folder, _, system = data
    form = "biwi" if system.fps == 25 else "vocaset"
    copy = shutil.copytree(folder, tmp_path / "data")
    gone = sorted((copy / "wav").iterdir())
    whole = FolderClips(copy, form, "train", system).names
    (copy / "wav" / f"{whole[0]}.wav").unlink()
    assert FolderClips(copy, form, "train", system).names == whole[1:]
    assert f"1 clips without a wav are left out: {whole[0]}" in capsys.readouterr().err
    for file in gone:
        file.unlink(missing_ok=True)
    with pytest.raises(DataSetError, match="no wav of any"):
        FolderClips(copy, form, "train", system)
