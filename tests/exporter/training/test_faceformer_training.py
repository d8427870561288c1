"""FaceFormer is trained as published: on its own past, the gradient running through all of it."""

import csv
import dataclasses
import json

import numpy as np
import pytest
import torch
import yaml
from conftest import DATA, FORMS, make_folder

from facecode_exporter.cli.main import main
from facecode_exporter.config import system_from_config
from facecode_exporter.data.clips import FolderClips
from facecode_exporter.data.data_set import LAYOUTS
from facecode_exporter.faceformer_checkpoint import load_faceformer
from facecode_exporter.random_weights import random_network
from facecode_exporter.training import run
from facecode_exporter.training.config import faceformer_defaults
from facecode_exporter.training.faceformer import FaceFormerStage, own_motion


@pytest.fixture(scope="module", params=FORMS)
def data(request, tmp_path_factory):
    """(folder, options that name the small system, the system)."""
    form = request.param
    case, root = DATA / f"faceformer-{form}-tiny", tmp_path_factory.mktemp(form)
    config = yaml.safe_load((case / "config.yaml").read_text())
    config["train_subjects"] = " ".join(LAYOUTS[form].seen)
    (root / "config.yaml").write_text(yaml.safe_dump(config))
    options = ["--config", str(root / "config.yaml")]
    options += ["--wav2vec2-config", str(case / "wav2vec2.json")]
    system = system_from_config(root / "config.yaml", case / "wav2vec2.json")
    return make_folder(root / "data", form, system.n_vertices), options, system


def train(data, out, *more):
    folder, options, _ = data
    args = ["train", "faceformer", "--data", str(folder), *options, "--out", str(out), "--quiet"]
    return main([*args, "--random-speech-encoder", *more])


def plain_motion(net, style, memory, n_frames):
    """The published loop word for word: vertices of the whole prefix, embedded anew each time."""
    decoder = net.part.cross_modal_decoder
    rows = net.system.speech_encoder.memory_rows_per_frame
    layer = net.transformer_decoder
    tokens = style[:, None]
    for step in range(n_frames):
        n = step + 1
        bias = torch.full((decoder.n_heads, n, n), -torch.inf)
        for head in range(decoder.n_heads):
            for i in range(n):
                for j in range(i + 1):
                    bias[head, i, j] = -((i - j) // decoder.period) * 4.0 ** -(head + 1)
        hidden_from = torch.ones(n, memory.shape[1], dtype=torch.bool)
        for i in range(n):
            hidden_from[i, rows * i : rows * (i + 1)] = False
        position = net.position_code.repeat(n // decoder.period + 1, 1)[:n]
        bias = bias.repeat(len(style), 1, 1)
        hidden = layer(tokens + position, memory, tgt_mask=bias, memory_mask=hidden_from)
        every = net.vertice_map_r(hidden)
        newest = net.vertice_map(every[:, -1:]) + style[:, None]
        tokens = torch.cat([tokens, newest], dim=1)
    return every


@pytest.mark.parametrize("n_frames", [1, 2, 33])
def test_loss_and_gradients_are_those_of_the_published_loop(data, n_frames):
    _, _, system = data
    net = random_network(system, seed=2).train()
    generator = torch.Generator().manual_seed(3)
    rows = system.speech_encoder.memory_rows_per_frame
    speech = torch.randn(2, n_frames * rows, 768, generator=generator)
    truth = torch.randn(2, n_frames, 3 * system.n_vertices, generator=generator)
    style = torch.tensor([0, 1])
    found = []
    for motion in (plain_motion, own_motion):
        net.zero_grad(set_to_none=True)
        said = motion(net, net.style_rows[style], net.audio_feature_map(speech), n_frames)
        loss = (said - truth).square().mean()
        loss.backward()
        gradients = {n: p.grad for n, p in net.named_parameters() if p.grad is not None}
        found.append((float(loss.detach()), gradients))
    (want, plain), (got, ours) = found
    assert got == pytest.approx(want, rel=1e-6)
    assert set(plain) == set(ours) >= {"obj_vector.weight", "audio_feature_map.weight"}
    assert ("vertice_map.weight" in plain) == (n_frames > 1) or not plain[
        "vertice_map.weight"
    ].any()
    for name, gradient in plain.items():
        scale = float(gradient.abs().max())
        torch.testing.assert_close(ours[name], gradient, rtol=1e-4, atol=1e-4 * scale + 1e-9)


def test_its_own_past_is_what_it_is_used_on(data):
    _, _, system = data
    net = random_network(system, seed=2).eval()
    audio = torch.randn(1, 9000, generator=torch.Generator().manual_seed(1))
    weights = torch.eye(len(system.styles))[:1]
    truth = net.predict(audio, weights).offsets.flatten(2)
    with torch.no_grad():
        said = own_motion(net, net.style_rows[[0]], net.memory(audio), truth.shape[1])
    torch.testing.assert_close(said, truth, rtol=0, atol=1e-5)


def test_teacher_forcing_is_another_loss_and_starts_alike(data):
    folder, _, system = data
    form = "biwi" if system.fps == 25 else "vocaset"
    clips = [FolderClips(folder, form, split, system) for split in ("train", "validation")]
    net = random_network(system, seed=2)
    config = dataclasses.replace(faceformer_defaults(system.name, ""), decoder_dropout=0.0)
    stage, group = FaceFormerStage(net, *clips, config), [(0, 0, 9)]
    net.eval()
    with torch.no_grad():
        own, forced = (float(stage.loss("train", group, forced)) for forced in (False, True))
        first = [float(stage.loss("train", [(0, 0, 1)], forced)) for forced in (False, True)]
    assert own != pytest.approx(forced, rel=1e-3)
    assert first[0] == pytest.approx(first[1], rel=1e-6)


def test_dropout_is_of_training_alone(data):
    _, _, system = data
    net = random_network(system, seed=2)
    tokens, rows = torch.randn(1, 5, 64 if system.fps == 30 else 128), 5
    memory = torch.randn(1, rows * system.speech_encoder.memory_rows_per_frame, tokens.shape[2])
    with torch.no_grad():
        before = net.eval().hidden(tokens, memory)
        net.drop(0.1)
        torch.testing.assert_close(net.hidden(tokens, memory), before, rtol=0, atol=0)
        net.train()
        torch.manual_seed(0)
        dropped = [net.hidden(tokens, memory) for _ in range(2)]
    assert not torch.equal(*dropped)
    assert not torch.allclose(dropped[0], before)


def test_from_a_folder_to_a_checkpoint(data, tmp_path, capsys):
    out = tmp_path / "run"
    more = ["--epochs", "3", "--learning-rate", "0.001", "--crop-frames", "12"]
    assert train(data, out, *more) == 0
    assert capsys.readouterr().out.strip() == str(out / "faceformer.pth")
    config = json.loads((out / "config.json").read_text())
    assert (config["stage"], config["decoder_dropout"], config["teacher_forcing"]) == (
        "faceformer", 0.1, False,
    )  # fmt: skip
    with (out / "losses.csv").open() as file:
        losses = [float(row["train_motion"]) for row in csv.DictReader(file)]
    assert losses[-1] < losses[0]
    net = load_faceformer(data[2], out / "faceformer.pth")
    fresh = random_network(data[2], seed=0)
    names = ("vertice_map_r.weight", "obj_vector.weight", "audio_encoder.encoder.layer_norm.weight")
    for name in names:
        assert not torch.equal(net.state_dict()[name], fresh.state_dict()[name]), name
    frozen = "audio_encoder.feature_extractor.conv_layers.0.conv.weight"
    assert torch.equal(net.state_dict()[frozen], fresh.state_dict()[frozen])


def test_interrupted_and_resumed_is_uninterrupted(data, tmp_path, monkeypatch):
    more = ["--epochs", "2", "--crop-frames", "8", "--teacher-forcing"]
    assert train(data, tmp_path / "whole", *more) == 0
    real, calls = run._epoch, []

    def interrupted(*args, **kwargs):
        calls.append(1)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return real(*args, **kwargs)

    with monkeypatch.context() as patch:
        patch.setattr(run, "_epoch", interrupted)
        assert train(data, tmp_path / "cut", *more) == 130
    assert train(data, tmp_path / "cut", *more) == 0
    whole, cut = (
        torch.load(tmp_path / name / "faceformer.pth", weights_only=True)
        for name in ("whole", "cut")
    )
    assert all(torch.equal(cut[name], value) for name, value in whole.items())


@pytest.mark.parametrize(
    ("stage", "system"),
    [("faceformer", "codetalker-vocaset"), ("stage2", "faceformer-vocaset"),
     ("faceformer", "codetalker-demo")],
)  # fmt: skip
def test_stages_of_other_systems_are_refused(tmp_path, capsys, stage, system):
    args = ["train", stage, "--system", system, "--data", str(tmp_path), "--out", str(tmp_path)]
    assert main([*args, "--quiet"]) == 2
    assert f"{system} and the stage {stage!r} do not go together" in capsys.readouterr().err


def test_styles_are_weighed_by_vectors(data):
    """A clip's style is a column of `obj_vector`, as in the public file."""
    _, _, system = data
    net = random_network(system, seed=2)
    one_hot = torch.eye(len(system.styles))
    torch.testing.assert_close(net.obj_vector(one_hot), net.style_rows)
    mix = torch.from_numpy(np.float32([[0.25, 0.75, *[0] * (len(system.styles) - 2)]]))
    torch.testing.assert_close(net.obj_vector(mix), mix @ net.style_rows)
