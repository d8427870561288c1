"""Losses and gradients of both stages beside the public formulas, written out from weights by name.

In training mode, nothing dropped, for motion shorter than, as long as, and longer than the speech.
"""

import dataclasses

import numpy as np
import pytest
import torch
import yaml
from conftest import DATA, FORMS, write_checkpoints
from torch.nn import functional as F
from transformers import Wav2Vec2Config, Wav2Vec2Model

from facecode.audio import load_audio
from facecode.level import normalise
from facecode_exporter.checkpoints import load_system
from facecode_exporter.config import system_from_config
from facecode_exporter.training.config import stage1_defaults, stage2_defaults
from facecode_exporter.training.stage1 import Stage1
from facecode_exporter.training.stage2 import Stage2

N_SAMPLES = 9000
NO_DROPOUT = dict.fromkeys(
    ("hidden_dropout", "attention_dropout", "activation_dropout", "feat_proj_dropout", "layerdrop"),
    0.0,
)


class OneClip:
    """A clip of `n_frames`, over the same speech whatever their number."""

    names = ("clip",)

    def __init__(self, n_frames, n_vertices, waveform):
        rng = np.random.default_rng(n_frames)
        self.motion = (0.3 * rng.standard_normal((n_frames, 3 * n_vertices))).astype(np.float32)
        self.waveform = waveform

    def offsets(self, _):
        return self.motion

    def audio(self, _):
        return self.waveform

    def style(self, _):
        return 1


@pytest.fixture(scope="module", params=FORMS)
def case(request, tmp_path_factory):
    """(system, files, states, public configuration, waveform)."""
    folder = DATA / f"codetalker-{request.param}-tiny"
    golden = write_checkpoints(folder, tmp_path_factory.mktemp("golden"))
    system = system_from_config(folder / "config.yaml", folder / "wav2vec2.json")
    encoder = system.speech_encoder
    encoder = dataclasses.replace(encoder, architecture={**encoder.architecture, **NO_DROPOUT})
    system = dataclasses.replace(system, speech_encoder=encoder)
    fields = yaml.safe_load((folder / "config.yaml").read_text())
    public = {k: v for section in fields.values() for k, v in section.items()}
    waveform = load_audio(folder / "speech.wav", 16_000)[4000 : 4000 + N_SAMPLES]
    return system, golden.files, public, np.ascontiguousarray(waveform)


def loaded(case):
    """Our network, and the same weights as leaves of the formulas, by their public names."""
    system, files, _, _ = case
    net = load_system(system, [files["stage1"]], [files["stage2"]])
    with torch.no_grad():
        net.vertice_map.bias.zero_()  # where it is zero, both begin with the same token
    leaves = {}
    for stage in ("stage1", "stage2"):
        state = torch.load(files[stage], weights_only=True)["state_dict"]
        leaves |= {k: v.clone().requires_grad_(v.is_floating_point()) for k, v in state.items()}
    with torch.no_grad():
        leaves["vertice_map.bias"].zero_()
    return net, leaves


def linear(x, w, name):
    return F.linear(x, w[f"{name}.weight"], w.get(f"{name}.bias"))


def norm(x, w, name):
    return F.layer_norm(x, x.shape[-1:], w[f"{name}.weight"], w[f"{name}.bias"])


def trunk(x, w, side, public):
    """Convolution, instance norm, linear layer, row 0 of the table, pre-norm layers."""
    convolution = {"encoder": "squasher", "decoder": "expander"}[side]
    name = f"{side}.{convolution}.0"
    x = F.pad(x.transpose(1, 2), (2, 2), mode="replicate")
    x = F.conv1d(x, w[f"{name}.0.weight"], w[f"{name}.0.bias"])
    x = F.leaky_relu(x, public["neg"])
    x = F.instance_norm(x, weight=w.get(f"{name}.2.weight"), bias=w.get(f"{name}.2.bias"))
    x = linear(x.transpose(1, 2), w, f"{side}.{side}_linear_embedding.net")
    x = x + w[f"{side}.{side}_pos_embedding.pe"][0]
    n_heads, width = public["num_attention_heads"], public["hidden_size"]
    for i in range(public["num_hidden_layers"]):
        at, ml = (f"{side}.{side}_transformer.net.{2 * i + k}.fn" for k in (0, 1))
        qkv = F.linear(norm(x, w, f"{at}.norm"), w[f"{at}.fn.to_qkv.weight"])
        q, k, v = qkv.unflatten(-1, (3, n_heads, -1)).permute(2, 0, 3, 1, 4)
        scores = torch.einsum("bhid,bhjd->bhij", q, k) / width**0.5
        mixed = torch.einsum("bhij,bhjd->bihd", scores.softmax(dim=-1), v).flatten(2)
        x = x + linear(mixed, w, f"{at}.fn.to_out")
        inner = F.gelu(linear(norm(x, w, f"{ml}.norm"), w, f"{ml}.fn.l1"), approximate="tanh")
        x = x + linear(inner, w, f"{ml}.fn.l2")
    return x


def encoded(offsets, w, public):
    x = F.leaky_relu(linear(offsets, w, "encoder.vertice_mapping.0"), public["neg"])
    x = trunk(x, w, "encoder", public)
    name = "encoder.encoder_linear_embedding_post.net"
    x = linear(x, w, name) if f"{name}.weight" in w else x
    return x.unflatten(-1, (public["face_quan_num"], public["zquant_dim"]))


def quantised(z, w):
    """Nearest vectors, the gradient passing to z; and the two terms of the codebook."""
    book = w["quantize.embedding.weight"]
    nearest = book[(z[..., None, :] - book).square().sum(dim=-1).argmin(dim=-1)]
    commitment = (nearest.detach() - z).square().mean()
    codebook = (nearest - z.detach()).square().mean()
    return z + (nearest - z).detach(), codebook, commitment


def decoded(vectors, w, public):
    x, name = vectors.flatten(2), "decoder.decoder_linear_embedding_pre.net"
    x = linear(x, w, name) if f"{name}.weight" in w else x
    return linear(trunk(x, w, "decoder", public), w, "decoder.vertice_map_reverse")


def public_stage1(offsets, w, public):
    through, codebook, commitment = quantised(encoded(offsets, w, public), w)
    reconstruction = (decoded(through, w, public) - offsets).abs().mean()
    return reconstruction + codebook + 0.25 * commitment


def heard(w, case, n_frames):
    """Hugging Face's encoder on features of the motion's length, its weights being leaves."""
    system, _, public, waveform = case
    architecture = {**system.speech_encoder.architecture, "apply_spec_augment": False}
    model = Wav2Vec2Model(Wav2Vec2Config(**architecture)).train()
    prefix, conv = "audio_encoder.", "encoder.pos_conv_embed.conv"
    norms = {"weight_g": "original0", "weight_v": "original1"}
    names = {f"{conv}.{a}": f"{conv}.parametrizations.weight.{b}" for a, b in norms.items()}
    own = {k.removeprefix(prefix): v for k, v in w.items() if k.startswith(prefix)}
    own = {names.get(k, k): v for k, v in own.items()}
    audio = torch.from_numpy(normalise(waveform))[None]

    def listen(module, x):
        features = module.feature_extractor(x).transpose(1, 2)
        if public["dataset"] == "BIWI":
            features = features[:, : min(features.shape[1] // 2, n_frames) * 2]
        else:
            features = F.interpolate(
                features.transpose(1, 2), size=n_frames, align_corners=True, mode="linear"
            ).transpose(1, 2)
        return module.encoder(module.feature_projection(features)[0]).last_hidden_state

    model.forward = lambda x: listen(model, x)
    return torch.func.functional_call(model, own, (audio,), strict=False)


def attention(x, memory, hidden, w, name, n_heads):
    """Softmax over scores plus `hidden`: minus infinity where one may not look."""
    wq, wk, wv = w[f"{name}.in_proj_weight"].chunk(3)
    bq, bk, bv = w[f"{name}.in_proj_bias"].chunk(3)
    split = (n_heads, -1)
    q = F.linear(x, wq, bq).unflatten(-1, split)
    k, v = (F.linear(memory, a, b).unflatten(-1, split) for a, b in ((wk, bk), (wv, bv)))
    scores = torch.einsum("bihd,bjhd->bhij", q, k) / q.shape[-1] ** 0.5 + hidden
    mixed = torch.einsum("bhij,bjhd->bihd", scores.softmax(dim=-1), v).flatten(2)
    return linear(mixed, w, f"{name}.out_proj")


def public_stage2(offsets, w, case):
    _, _, public, _ = case
    rows = 2 if public["dataset"] == "BIWI" else 1
    memory = heard(w, case, offsets.shape[1])
    n = min(offsets.shape[1], memory.shape[1] // rows)
    offsets, memory = offsets[:, :n], linear(memory, w, "audio_feature_map")
    style = w["learnable_style_emb.weight"][1]
    past = torch.cat([torch.zeros_like(offsets[:, :1]), offsets[:, :-1]], dim=1)
    x = linear(past, w, "vertice_map") + style + w["PPE.pe"][:, :n]
    n_heads = public["n_head"]
    temporal = torch.full((n_heads, n, n), -torch.inf)
    aligned = torch.full((n, memory.shape[1]), -torch.inf)
    for i in range(n):
        aligned[i, rows * i : rows * (i + 1)] = 0
        for j in range(i + 1):
            for head in range(n_heads):
                slope = 2.0 ** (-8 * (head + 1) / n_heads)
                temporal[head, i, j] = -((i - j) // public["period"]) * slope
    for layer in range(public["num_layers"]):
        name = f"transformer_decoder.layers.{layer}"
        x = norm(x + attention(x, x, temporal, w, f"{name}.self_attn", n_heads), w, f"{name}.norm1")
        looked = attention(x, memory, aligned, w, f"{name}.multihead_attn", n_heads)
        x = norm(x + looked, w, f"{name}.norm2")
        inner = F.relu(linear(x, w, f"{name}.linear1"))
        x = norm(x + linear(inner, w, f"{name}.linear2"), w, f"{name}.norm3")
    features = F.linear(x, w["feat_map.weight"]).unflatten(-1, (public["face_quan_num"], -1))
    through, _, _ = quantised(features, w)
    true, _, _ = quantised(encoded(offsets, w, public), w)
    motion = (decoded(through, w, public) - offsets).square().mean()
    return motion + (features - true.detach()).square().mean()


def assert_same(ours, theirs, skip=()):
    """Gradients by name, each within 1e-4 of its largest."""
    assert ours.keys() - set(skip) == theirs.keys() - set(skip)
    assert len(ours) > 20
    for name in ours.keys() - set(skip):
        scale = float(theirs[name].abs().max())
        torch.testing.assert_close(
            ours[name], theirs[name], rtol=1e-4, atol=1e-4 * scale + 1e-9, msg=name
        )


def test_stage1(case):
    system, _, public, waveform = case
    net, leaves = loaded(case)
    clip = OneClip(13, system.n_vertices, waveform)
    config = dataclasses.replace(stage1_defaults("x", "d", True), position_dropout=0.0)
    stage = Stage1(net.autoencoder, clip, clip, config)
    net.train()
    loss, _ = next(stage.epoch(np.random.default_rng(0)))
    loss.backward()
    expected = public_stage1(torch.from_numpy(clip.motion)[None], leaves, public)
    expected.backward()
    assert loss.item() == pytest.approx(expected.item(), rel=1e-6)
    ours = {n: p.grad for n, p in net.autoencoder.named_parameters()}
    assert_same(ours, {n: p.grad for n, p in leaves.items() if n in ours})


@pytest.mark.parametrize("more", [-5, 0, 5])
def test_stage2(case, more):
    system, _, _, waveform = case
    net, leaves = loaded(case)
    n_frames = (27 // 2 if system.fps == 25 else int(27 / 50 * 30)) + more
    clip = OneClip(n_frames, system.n_vertices, waveform)
    off = dict.fromkeys(("decoder_dropout", "mask_share", "layer_drop", "encoder_dropout"), 0.0)
    config = dataclasses.replace(stage2_defaults("x", "d"), **off)
    stage = Stage2(net, clip, clip, config)
    net.train()
    loss, _ = next(stage.epoch(np.random.default_rng(0)))
    loss.backward()
    expected = public_stage2(torch.from_numpy(clip.motion)[None], leaves, case)
    expected.backward()
    assert loss.item() == pytest.approx(expected.item(), rel=1e-6)
    trained = {n: p for n, p in net.named_parameters() if p.requires_grad}
    ours = {n: p.grad for n, p in trained.items() if p.grad is not None}
    # The convolution's weight is one here, norm and direction there; of token 0, see the stage.
    skip = {"audio_encoder.encoder.pos_conv_embed.conv.weight", "vertice_map.bias"}
    assert_same(ours, {n: leaves[n].grad for n in ours if n in leaves} | dict.fromkeys(skip), skip)
    assert not any("feature_extractor" in name or "autoencoder" in name for name in ours)
