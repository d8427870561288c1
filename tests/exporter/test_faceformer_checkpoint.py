"""The one public file of FaceFormer in all its spellings, and files that are none."""

import pytest
import torch
import yaml
from conftest import DATA

from facecode_exporter.checkpoints import CONV, load_system
from facecode_exporter.cli.main import main
from facecode_exporter.config import system_from_config
from facecode_exporter.errors import CheckpointError, ConfigError
from facecode_exporter.faceformer_checkpoint import load_faceformer, save_faceformer
from facecode_exporter.random_weights import random_network
from facecode_spec.systems import SYSTEMS

TINY = SYSTEMS["faceformer-tiny"]
OPTIONS = yaml.safe_load((DATA / "faceformer-vocaset-tiny" / "config.yaml").read_text())


@pytest.fixture(scope="module")
def net():
    return random_network(TINY, seed=1)


@pytest.fixture
def file(net, tmp_path):
    save_faceformer(net, tmp_path / "vocaset.pth")
    return tmp_path / "vocaset.pth"


def edit(file, change):
    """Rewrite a checkpoint with what `change` makes of its state dict."""
    torch.save(change(torch.load(file, weights_only=True)), file)


def assert_same(net, other):
    for name, value in net.state_dict().items():
        torch.testing.assert_close(other.state_dict()[name], value, rtol=0, atol=1e-7, msg=name)


def test_public_layout_and_back(net, file):
    state = torch.load(file, weights_only=True)
    assert state["PPE.pe"].shape == (1, 630, 32)
    assert state["obj_vector.weight"].shape == (32, 3)
    assert {f"{CONV}.weight_g", f"{CONV}.weight_v", "vertice_map_r.bias"} <= set(state)
    assert_same(net, load_faceformer(TINY, file))


def test_other_spellings(net, file):
    def rename(state):
        for old, new in (("weight_g", "original0"), ("weight_v", "original1")):
            state[f"{CONV}.parametrizations.weight.{new}"] = state.pop(f"{CONV}.{old}")
        del state["PPE.pe"]
        return {"state_dict": {f"module.{name}": value for name, value in state.items()}}

    edit(file, rename)
    assert_same(net, load_faceformer(TINY, file))


def test_the_position_table_of_the_file_is_used(file):
    edit(file, lambda s: {**s, "PPE.pe": s["PPE.pe"] * 0 + 0.5})
    assert (load_faceformer(TINY, file).position_code == 0.5).all()


def test_all_problems_in_one_error(file):
    def damage(state):
        state["obj_vector.weight"] = state["obj_vector.weight"][:, :-1]
        state["surprise"] = torch.zeros(1)
        del state["vertice_map.bias"]
        return state

    edit(file, damage)
    with pytest.raises(CheckpointError) as caught:
        load_faceformer(TINY, file)
    text = str(caught.value)
    assert "faceformer-tiny, 3 problems" in text
    assert f"{file}: obj_vector.weight is (32, 2), expected (32, 3)" in text
    assert "surprise is not known" in text
    assert "vertice_map.bias (32,) is missing" in text


def test_files_of_other_systems(file, tmp_path):
    edit(file, lambda s: {**s, "vertice_map_r.weight": torch.zeros(15069, 32)})
    with pytest.raises(CheckpointError, match="fits --system faceformer-vocaset"):
        load_faceformer(TINY, file)
    torch.save({"state_dict": {"feat_map.weight": torch.zeros(1)}}, tmp_path / "other")
    with pytest.raises(CheckpointError, match=r"no FaceFormer file.*--stage1 and --stage2"):
        load_faceformer(TINY, tmp_path / "other")
    with pytest.raises(CheckpointError, match="one file, not two stages; give --checkpoint"):
        load_system(TINY, [file], [file])


def test_init(tmp_path, capsys):
    out = tmp_path / "random"
    assert main(["init", "--system", "faceformer-tiny", "--seed", "1", "--out", str(out)]) == 0
    assert capsys.readouterr().out == f"{out / 'faceformer.pth'}\n"
    assert_same(random_network(TINY, seed=1), load_faceformer(TINY, out / "faceformer.pth"))


@pytest.mark.parametrize(
    ("system", "files", "words"),
    [
        ("faceformer-tiny", [], "one file; give --checkpoint FILE alone"),
        ("faceformer-tiny", ["--stage1", "a", "--checkpoint", "b"], "--checkpoint FILE alone"),
        ("codetalker-tiny", ["--checkpoint", "a"], "give --stage1 FILE and --stage2 FILE"),
        ("codetalker-tiny", ["--stage1", "a"], "give --stage1 FILE and --stage2 FILE"),
    ],
)
def test_files_that_do_not_go_with_the_system(tmp_path, capsys, system, files, words):
    out = tmp_path / "bundle"
    assert main(["export", "--system", system, *files, "--out", str(out), "--quiet"]) == 2
    assert words in capsys.readouterr().err
    assert not out.exists()


def options(tmp_path, **changes):
    file = tmp_path / "options.yaml"
    given = {k: v for k, v in {**OPTIONS, **changes}.items() if v is not None}
    file.write_text(yaml.safe_dump(given))
    return file


def test_options_of_the_public_command_line(tmp_path):
    system = system_from_config(options(tmp_path, n_head=8, lr=0.0001))
    assert (system.family, system.n_vertices, system.fps) == ("faceformer", 120, 30)
    decoder = system.parts[0].cross_modal_decoder
    assert (decoder.dim, decoder.dim_feedforward, decoder.n_layers, decoder.n_heads) == (
        64, 128, 1, 4,
    )  # fmt: skip
    assert system.styles[:2] == ("s0", "s1")
    biwi = system_from_config(DATA / "faceformer-biwi-tiny" / "config.yaml")
    assert (biwi.fps, biwi.speech_encoder.frame_grid) == (25, "pairs")


def test_the_published_options_are_the_published_systems(tmp_path):
    for name, dataset in (("vocaset", "vocaset"), ("biwi", "BIWI")):
        system = SYSTEMS[f"faceformer-{name}"]
        decoder = system.parts[0].cross_modal_decoder
        file = options(
            tmp_path,
            dataset=dataset,
            vertice_dim=3 * system.n_vertices,
            feature_dim=decoder.dim,
            period=decoder.period,
            train_subjects=" ".join(system.styles),
        )
        assert system_from_config(file) == system


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"dataset": "meshtalk"}, "expected one of vocaset, BIWI"),
        ({"vertice_dim": 361}, "vertice_dim is 361; expected a multiple of 3"),
        ({"feature_dim": None}, "feature_dim is missing"),
        ({"feature_dim": 66}, "does not divide into 4 heads"),
        ({"period": 0}, "period=0.*expected sizes of 1 to"),
        ({"train_subjects": ""}, "expected different names"),
        ({"train_subjects": {"a": 1}}, "expected the sections"),
    ],
)
def test_unusable_options(tmp_path, changes, words):
    with pytest.raises(ConfigError, match=words):
        system_from_config(options(tmp_path, **changes))
