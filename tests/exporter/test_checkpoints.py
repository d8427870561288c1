"""Public checkpoint files in all their spellings, and files that are none."""

import argparse
import pickle

import pytest
import torch

from facecode_exporter.checkpoints import (
    CONV,
    load_system,
    read_state,
    save_system,
)
from facecode_exporter.errors import (
    CheckpointError,
    CheckpointNotFoundError,
    SwappedCheckpointsError,
)
from facecode_exporter.nets.speech_decoder import alibi_slopes
from facecode_exporter.random_weights import random_network
from facecode_spec.systems import SYSTEMS

TINY = SYSTEMS["codetalker-tiny"]


@pytest.fixture(scope="module")
def net():
    return random_network(TINY, seed=1)


@pytest.fixture
def files(net, tmp_path):
    paths = tmp_path / "stage1.pth.tar", tmp_path / "stage2.pth.tar"
    save_system(net, paths[:1], paths[1:])
    return paths


def edit(path, change):
    """Rewrite a checkpoint with what `change` makes of its state dict."""
    state = torch.load(path, weights_only=True)["state_dict"]
    torch.save({"state_dict": change(state)}, path)


def assert_same(net, other, atol=0.0):
    for name, value in net.state_dict().items():
        torch.testing.assert_close(other.state_dict()[name], value, rtol=0, atol=atol, msg=name)


def test_round_trip(net, files):
    assert_same(net, load_system(TINY, files[:1], files[1:]), atol=1e-7)


def test_public_layout(files):
    first, second = (torch.load(f, weights_only=True)["state_dict"] for f in files)
    assert first["decoder.decoder_pos_embedding.pe"].shape == (5000, 1, 32)
    assert second["PPE.pe"].shape == (1, 630, 32)
    assert {f"{CONV}.weight_g", f"{CONV}.weight_v", "audio_encoder.masked_spec_embed"} <= set(
        second
    )
    assert not any("autoencoder" in name for name in second)


def test_module_prefix(net, files):
    for file in files:
        edit(file, lambda state: {f"module.{k}": v for k, v in state.items()})
    assert_same(net, load_system(TINY, files[:1], files[1:]), atol=1e-7)


def test_new_weight_norm_names(net, files):
    def rename(state):
        for old, new in (("weight_g", "original0"), ("weight_v", "original1")):
            state[f"{CONV}.parametrizations.weight.{new}"] = state.pop(f"{CONV}.{old}")
        return state

    edit(files[1], rename)
    assert_same(net, load_system(TINY, files[:1], files[1:]), atol=1e-7)


def test_weight_norm_is_folded_as_torch_does(files):
    def scale(state):
        state[f"{CONV}.weight_g"] *= torch.linspace(0.5, 2, 16)
        state[f"{CONV}.weight_v"] *= 3
        return state

    edit(files[1], scale)
    state = torch.load(files[1], weights_only=True)["state_dict"]
    want = torch._weight_norm(state[f"{CONV}.weight_v"], state[f"{CONV}.weight_g"], 2)
    folded = load_system(
        TINY, files[:1], files[1:]
    ).audio_encoder.encoder.pos_conv_embed.conv.weight
    torch.testing.assert_close(folded, want)


@pytest.mark.parametrize("dtype", [torch.float16, torch.float64, torch.bfloat16])
def test_other_dtypes(net, files, dtype):
    for file in files:
        edit(file, lambda state: {k: v.to(dtype) for k, v in state.items()})
    loaded = load_system(TINY, files[:1], files[1:])
    assert loaded.feat_map.weight.dtype == torch.float32
    assert_same(net, loaded, atol=1e-7 if dtype == torch.float64 else 2e-2)


def test_position_tables_may_be_absent(net, files):
    edit(files[0], lambda s: {k: v for k, v in s.items() if not k.endswith(".pe")})
    edit(files[1], lambda s: {k: v for k, v in s.items() if k != "PPE.pe"})
    loaded = load_system(TINY, files[:1], files[1:])
    torch.testing.assert_close(loaded.position_code, net.position_code)


def test_position_tables_of_the_file_are_used(files):
    for file in files:
        edit(file, lambda s: {k: v * 0 + 0.5 if k.endswith("pe") else v for k, v in s.items()})
    loaded = load_system(TINY, files[:1], files[1:])
    assert (loaded.autoencoder.decoder.constant == 0.5).all()
    assert (loaded.position_code == 0.5).all()


def test_plain_state_dict_and_saved_autoencoder(net, files):
    first = torch.load(files[0], weights_only=True)["state_dict"]
    edit(files[1], lambda s: {**s, **{f"autoencoder.{k}": v for k, v in first.items()}})
    torch.save(first, files[0])
    assert_same(net, load_system(TINY, files[:1], files[1:]), atol=1e-7)


def test_all_problems_in_one_error(files):
    def damage(state):
        state["feat_map.weight"] = state["feat_map.weight"][:-1]
        state["surprise"] = torch.zeros(1)
        del state["vertice_map.bias"]
        state["audio_feature_map.bias"][3] = float("nan")
        return state

    edit(files[1], damage)
    edit(files[0], lambda s: {k: v for k, v in s.items() if not k.startswith("quantize")})
    with pytest.raises(CheckpointError) as caught:
        load_system(TINY, files[:1], files[1:])
    text = str(caught.value)
    assert "5 problems" in text
    assert f"stage 1, {files[0]}: quantize.embedding.weight (32, 8) is missing" in text
    assert f"stage 2, {files[1]}: vertice_map.bias (32,) is missing" in text
    assert "surprise is not known" in text
    assert "feat_map.weight is (31, 32), expected (32, 32)" in text
    assert "audio_feature_map.bias holds NaN" in text


def test_many_problems_are_cut(files):
    edit(files[1], lambda s: {k: v for k, v in s.items() if k.startswith("transformer_decoder")})
    with pytest.raises(CheckpointError, match="more"):
        load_system(TINY, files[:1], files[1:])


def test_swapped_files(files):
    with pytest.raises(SwappedCheckpointsError, match="Exchange --stage1 and --stage2"):
        load_system(TINY, files[1:], files[:1])
    with pytest.raises(CheckpointError, match="is a stage-1 file"):
        load_system(TINY, files[:1], files[:1])
    with pytest.raises(CheckpointError, match="is a stage-2 file"):
        load_system(TINY, files[1:], files[1:])


def test_files_of_another_system(files):
    edit(files[0], lambda s: {**s, "decoder.vertice_map_reverse.weight": torch.zeros(15069, 32)})
    with pytest.raises(CheckpointError, match="fits --system codetalker-vocaset"):
        load_system(TINY, files[:1], files[1:])


class Malice:
    def __reduce__(self):
        return print, ("code from a checkpoint ran",)


@pytest.mark.parametrize("content", [b"hello", b"PK\3\4broken", pickle.dumps(Malice())])
def test_not_a_checkpoint(tmp_path, capsys, content):
    file = tmp_path / "stage1.pth.tar"
    file.write_bytes(content)
    with pytest.raises(CheckpointError, match="is not a PyTorch checkpoint"):
        read_state(file)
    assert "ran" not in capsys.readouterr().out


@pytest.mark.parametrize("content", [[1], {}, {"state_dict": {}}, {"state_dict": {"a": 1}}])
def test_checkpoints_without_tensors(tmp_path, content):
    file = tmp_path / "stage1.pth.tar"
    torch.save(content, file)
    with pytest.raises(CheckpointError):
        read_state(file)


def test_no_file(tmp_path):
    with pytest.raises(CheckpointNotFoundError):
        read_state(tmp_path / "none")


def test_random_weights_follow_the_seed_and_leave_torch_alone(net):
    before = torch.random.get_rng_state()
    assert_same(net, random_network(TINY, seed=1))
    assert not torch.equal(random_network(TINY, seed=2).feat_map.weight, net.feat_map.weight)
    assert torch.equal(torch.random.get_rng_state(), before)


def test_alibi_slopes():
    assert alibi_slopes(4) == [2**-2, 2**-4, 2**-6, 2**-8]
    assert alibi_slopes(3) == [2**-4, 2**-8, 2**-2]


@pytest.mark.parametrize(
    ("head", "what"),
    [
        (b"<!DOCTYPE html>", "a web page"),
        (b"\n <html>", "a web page"),
        (b"version https://git-lfs.github.com/spec/v1", "a Git LFS pointer"),
        ((64).to_bytes(8, "little") + b'{"a":', "a safetensors file"),
        (b"\x1f\x8b\x08", "a compressed archive"),
        (b"\0" * 257 + b"ustar", "a tar archive"),
        (b"", "is empty"),
        (b"\x80\x02}q\x00.", "damaged"),
        (b"\x80\x02K\x01.", "damaged"),
        (b"\x80\x04]\x94", "damaged or cut short"),
    ],
)
def test_what_people_take_for_a_checkpoint(tmp_path, head, what):
    file = tmp_path / "stage1.pth.tar"
    file.write_bytes(head)
    with pytest.raises(CheckpointError, match=what) as caught:
        read_state(file)
    assert "weights_only" not in str(caught.value)
    assert "\n" not in str(caught.value)
    with pytest.raises(CheckpointNotFoundError, match="a folder, not a file"):
        read_state(tmp_path)


def test_objects_beside_the_weights_are_named(tmp_path):
    file = tmp_path / "stage1.pth.tar"
    args = argparse.Namespace(lr=1)
    torch.save({"state_dict": {"a": torch.ones(2)}, "args": args}, file)
    with pytest.raises(CheckpointError, match=r"objects of argparse\.Namespace beside") as caught:
        read_state(file)
    assert "\n" not in str(caught.value)
    torch.jit.save(torch.jit.script(torch.nn.Linear(2, 2)), file)
    with pytest.raises(CheckpointError, match="TorchScript"):
        read_state(file)


@pytest.mark.parametrize(
    "holder", ["state_dict", "model_state_dict", "model", "net", "network", "ema", None]
)
@pytest.mark.parametrize("prefix", ["", "module.", "_orig_mod.", "_orig_mod.module."])
def test_wherever_programs_put_the_weights(tmp_path, holder, prefix):
    file = tmp_path / "stage1.pth.tar"
    state = {f"{prefix}a.b": torch.ones(2).half(), "n_averaged": torch.tensor(3)}
    more = {"epoch": 3, "optimizer": {"lr": 1.0}, "best": 0.1}
    torch.save({**more, holder: state} if holder else {**more, **state}, file)
    assert {k: v.tolist() for k, v in read_state(file).items()} == {"a.b": [1.0, 1.0]}


def test_wrappers_within_names_and_nested_holders(tmp_path):
    file = tmp_path / "a.pth"
    torch.save({"model": {"state_dict": {"encoder._orig_mod.module.w": torch.ones(1)}}}, file)
    assert set(read_state(file)) == {"encoder.w"}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"model": {"a": torch.ones(1)}, "ema": {"a": torch.ones(1)}}, "several sets of weights"),
        ({"a": torch.ones(1), "module.a": torch.ones(1)}, "'a' twice"),
        ({"a": torch.ones(2, dtype=torch.int64)}, "torch.int64"),
        ({"a": torch.ones(2, dtype=torch.complex64)}, "torch.complex64"),
        ({"a": torch.eye(2).to_sparse()}, "sparse"),
        ({"a": torch.ones(1).expand(100_000, 100_000)}, "more than it can hold"),
        ([torch.ones(1)], "holds list"),
        (torch.ones(1), "holds Tensor"),
    ],
)
def test_weights_of_another_kind(tmp_path, content, words):
    torch.save(content, tmp_path / "a.pth")
    with pytest.raises(CheckpointError, match=words):
        read_state(tmp_path / "a.pth")


@pytest.mark.parametrize("shape", [(), (1, 29, 32), (1, 630, 31), (0, 32)])
def test_position_tables_that_do_not_fit(files, shape):
    """The tiny system has a period of 30."""
    edit(files[1], lambda s: {**s, "PPE.pe": torch.zeros(shape)})
    with pytest.raises(CheckpointError, match=r"PPE\.pe is .*expected 30 rows or more of 32"):
        load_system(TINY, files[:1], files[1:])


@pytest.mark.parametrize("shape", [(), (5000, 1, 31), (0, 1, 32)])
def test_constants_that_do_not_fit(files, shape):
    name = "decoder.decoder_pos_embedding.pe"
    edit(files[0], lambda s: {**s, name: torch.zeros(shape)})
    with pytest.raises(CheckpointError, match="expected 1 rows or more of 32"):
        load_system(TINY, files[:1], files[1:])
    edit(files[0], lambda s: {**s, name: torch.full((5000, 1, 32), float("nan"))})
    with pytest.raises(CheckpointError, match="pe holds NaN"):
        load_system(TINY, files[:1], files[1:])


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("shape", [(), (0,), (3,), (2, 2, 2, 2)])
def test_any_tensor_of_any_shape_is_told(files, which, shape):
    """No shape of any tensor ends in an error of torch's own."""
    edit(files[which], lambda s: dict.fromkeys(s, torch.ones(shape)))
    with pytest.raises(CheckpointError, match="problems"):
        load_system(TINY, files[:1], files[1:])


def test_truncated_anywhere(files):
    data = files[0].read_bytes()
    for size in (1, 7, 100, len(data) // 3, len(data) // 2, len(data) - 1):
        files[0].write_bytes(data[:size])
        with pytest.raises(CheckpointError, match="damaged or cut short"):
            read_state(files[0])
