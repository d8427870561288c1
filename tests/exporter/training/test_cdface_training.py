"""CDFace's stages on a tiny folder in the public layout, from the command line to a bundle."""

import dataclasses
import json

import numpy as np
import pytest
import torch
from conftest import SPEECH, make_folder

import facecode
from facecode_exporter.cli.main import main
from facecode_exporter.data.clips import FolderClips, FolderPart
from facecode_exporter.errors import RegionError
from facecode_exporter.face_parts import part_vertices, variant
from facecode_exporter.nets.cdface import CDFace
from facecode_exporter.training import run
from facecode_exporter.training.config import cdface_defaults
from facecode_exporter.training.heads import sort_heads, start_from_one
from facecode_exporter.training.query import QueryStage, unprompted
from facecode_spec.systems import SYSTEMS

TINY = SYSTEMS["cdface-tiny"]
PAIR = (1, 3)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    root = tmp_path_factory.mktemp("cdface")
    (root / "lips.txt").write_text(",".join(str(2 * i) for i in range(17)))
    return make_folder(root / "data", "vocaset", TINY.n_vertices)


def train(data, out, stage, part, *more):
    args = ["train", stage, "--system", "cdface-tiny", "--data", str(data), "--out", str(out)]
    lips = str(data.parent / "lips.txt")
    args += ["--random-speech-encoder", "--part", part, "--lips", lips, "--epochs", "2"]
    return main([*args, "--quiet", *map(str, more)])


QUERY = ("--lip-pair", "1,3", "--batch-size", "3", "--crop-frames", "12")


def train_all(data, root, order=("lips", "upper-face"), *more):
    """Both parts; their checkpoints as options of `export`."""
    files = {"--stage1": [], "--stage2": []}
    for i, part in enumerate(order):
        assert train(data, root / f"{part}1", "stage1", part, *more) == 0
        stage1 = root / f"{part}1" / "stage1.pth.tar"
        options = ["--stage1", stage1, *QUERY, *more]
        if i:
            options += ["--earlier", files["--stage1"][0], files["--stage2"][0]]
        assert train(data, root / f"{part}2", "cdface", part, *options) == 0
        files["--stage1"].append(stage1)
        files["--stage2"].append(root / f"{part}2" / "stage2.pth.tar")
    return [str(x) for name, paths in files.items() for x in (name, *paths)]


def export(data, files, out, *more):
    lips = str(data.parent / "lips.txt")
    args = ["export", "--system", "cdface-tiny", "--lips", lips, *files, "--out", str(out)]
    return main([*args, "--quiet", *more])


def test_both_parts_then_export_and_animate(data, tmp_path):
    files = train_all(data, tmp_path)
    assert export(data, files, tmp_path / "bundle") == 0
    takes = facecode.load(tmp_path / "bundle").animate(SPEECH, samples={"lips": 3, "upper_face": 2})
    assert len(takes) == 6
    config = json.loads((tmp_path / "lips2" / "config.json").read_text())
    assert (config["part"], config["losses"]["mask"]) == ("lips", True)
    header = (tmp_path / "lips2" / "losses.csv").read_text().splitlines()[0]
    assert "train_closure" in header


def test_deterministic_and_upper_face_first(data, tmp_path):
    more = ("--samples", "1", "--upper-first")
    files = train_all(data, tmp_path, ("upper-face", "lips"), *more)
    assert export(data, files, tmp_path / "bundle", *more) == 0
    face = facecode.load(tmp_path / "bundle")
    assert [p.name for p in face.engine.parts] == ["upper_face", "lips"]
    assert [p.n_samples for p in face.engine.parts] == [1, 1]
    assert (tmp_path / "lips2" / "losses.csv").read_text().splitlines()[1].split(",")[1] == "0"


def test_heads_start_from_the_one_that_was_trained_alone(data, tmp_path):
    assert train(data, tmp_path / "prior", "stage1", "lips") == 0
    more = ("--stage1", tmp_path / "prior" / "stage1.pth.tar", *QUERY)
    assert train(data, tmp_path / "one", "cdface", "lips", *more, "--samples", "1") == 0
    start = ("--start", tmp_path / "one" / "stage2.pth.tar", "--epochs", "0")
    assert train(data, tmp_path / "all", "cdface", "lips", *more, *start) == 0
    one, all_heads = (
        torch.load(tmp_path / n / "stage2.pth.tar", weights_only=True)["state_dict"]
        for n in ("one", "all")
    )
    assert all(torch.equal(all_heads[n], v) for n, v in one.items() if "feat_map" not in n)
    (name,) = (n for n in one if "feat_map" in n)
    heads = all_heads[name].unflatten(0, (-1, len(one[name])))
    share = (heads - one[name]).square().mean().sqrt() / one[name].square().mean().sqrt()
    assert float(share) == pytest.approx(1.5, rel=0.15)  # TrainingConfig.head_spread


def test_resumed_is_uninterrupted(data, tmp_path, monkeypatch):
    assert train(data, tmp_path / "one", "stage1", "lips") == 0
    more = ("--stage1", tmp_path / "one" / "stage1.pth.tar", *QUERY, "--epochs", "3")
    assert train(data, tmp_path / "whole", "cdface", "lips", *more) == 0
    real, calls = run._epoch, []

    def interrupted(*args, **kwargs):
        calls.append(1)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return real(*args, **kwargs)

    with monkeypatch.context() as patch:
        patch.setattr(run, "_epoch", interrupted)
        assert train(data, tmp_path / "cut", "cdface", "lips", *more) == 130
    assert train(data, tmp_path / "cut", "cdface", "lips", *more) == 0
    whole, cut = (
        torch.load(tmp_path / n / "stage2.pth.tar", weights_only=True)["state_dict"]
        for n in ("whole", "cut")
    )
    assert all(torch.equal(cut[name], value) for name, value in whole.items())


def stage_of(data, part, **losses):
    vertices = part_vertices(TINY, data.parent / "lips.txt")
    clips = [
        FolderPart(FolderClips(data, "vocaset", s, TINY), vertices[part], PAIR)
        for s in ("train", "validation")
    ]
    config = cdface_defaults("cdface-tiny", "data", part, True)
    losses = dataclasses.replace(config.losses, **losses)
    torch.manual_seed(0)
    return QueryStage(
        CDFace(TINY), *clips, dataclasses.replace(config, losses=losses, batch_size=3)
    )


@pytest.mark.parametrize("part", ["lips", "upper_face"])
def test_gradient_reaches_the_query_network_and_nothing_that_is_frozen(data, part):
    """Through the quantiser alone: the terms that need no decoded motion are left out."""
    stage = stage_of(data, part, regulariser=0.0, target_code=0.0)
    stage.trained.train()
    loss, _ = next(iter(stage.epoch(np.random.default_rng(0))))
    loss.backward()
    moved = {n for n, p in stage.net.named_parameters() if p.grad is not None and p.grad.any()}
    assert "feat_map.weight" in moved
    assert "transformer_decoder.layers.0.linear1.weight" in moved
    assert "audio_feature_map.weight" in moved
    assert ("condition_map.lips.weight" in moved) == (part == "upper_face")
    assert not any(name.startswith("autoencoder.") for name in moved)
    heads = stage.net.feat_map.weight.grad.unflatten(0, (stage.net.part.n_samples, -1))
    assert heads.flatten(1).any(dim=1).all()
    speech = [p.grad for p in stage.trained.audio_encoder.parameters() if p.grad is not None]
    assert bool(speech) == (part == "lips")
    assert all(p.grad is None for net in stage.earlier for p in net.parameters())


def test_only_lips_are_masked(data):
    terms = {p: stage_of(data, p).validate() for p in ("lips", "upper_face")}
    closure = stage_of(data, "lips").terms.index("closure")
    assert terms["lips"][closure] > 0
    assert terms["upper_face"][closure] == 0
    assert stage_of(data, "lips", mask=False).validate()[closure] == 0


def test_samples_start_near_the_one_that_was_trained():
    torch.manual_seed(0)
    net, one = CDFace(TINY).part_nets[0], CDFace(variant(TINY, 1, False)).part_nets[0]
    start_from_one(net, one, 0.01)
    memory, style = torch.randn(1, 24, net.audio_feature_map.out_features), torch.tensor([0])
    n = memory.shape[1] // TINY.speech_encoder.memory_rows_per_frame
    with torch.no_grad():
        many = unprompted(net, memory, style, {})
        single = unprompted(one, memory, style, {}).expand_as(many)
    assert many.shape[:3] == (1, TINY.parts[0].n_samples, n)
    torch.testing.assert_close(many, single, rtol=0, atol=0.05)
    assert (many[:, 0] != many[:, 1]).any()


def test_the_head_of_the_smallest_error_comes_first(data):
    stage = stage_of(data, "lips")
    errors = stage.head_errors()
    assert errors.shape == (stage.net.part.n_samples,)
    assert float(errors.mean()) == pytest.approx(
        stage.validate()[stage.terms.index("every_sample")] * stage.unit**2, rel=0.2
    )
    sort_heads(stage.net, errors)
    torch.testing.assert_close(stage.head_errors(), errors.sort().values)


def test_parts_cover_every_vertex_once(data, tmp_path):
    vertices = part_vertices(TINY, data.parent / "lips.txt")
    assert sorted(np.concatenate(list(vertices.values()))) == list(range(42))
    clips = FolderClips(data, "vocaset", "train", TINY)
    part = FolderPart(clips, vertices["lips"], PAIR)
    whole = clips.offsets(0).reshape(-1, 42, 3)
    np.testing.assert_array_equal(part.offsets(0).reshape(-1, 17, 3), whole[:, vertices["lips"]])
    with pytest.raises(RegionError, match="give --lips FILE"):
        part_vertices(TINY, None)
    (tmp_path / "all.txt").write_text(",".join(map(str, range(42))))
    with pytest.raises(RegionError, match="expected some, not all"):
        part_vertices(TINY, tmp_path / "all.txt")


def test_variants_keep_the_parts(data):
    system = variant(TINY, 1, upper_first=True)
    assert [p.name for p in system.parts] == ["upper_face", "lips"]
    assert [p.conditions_on for p in system.parts] == [(), ("upper_face",)]
    assert variant(TINY, None, upper_first=False) == TINY


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("cdface", "lips"), "needs --stage1"),
        (("cdface", "lips", "--stage1", "x"), "needs --lip-pair"),
        (("cdface", "upper-face", "--stage1", "x", "--lip-pair", "1,3"), "--earlier STAGE1 STAGE2"),
        (("stage2", "lips"), "train cdface --part P"),
    ],
)
def test_what_is_missing_is_said(data, tmp_path, capsys, options, message):
    assert train(data, tmp_path / "x", *options) == 2
    assert message in capsys.readouterr().err
