"""Torch against the runtime on random systems of odd sizes, at odd lengths and batch sizes."""

import dataclasses

import numpy as np
import pytest
import torch

from facecode.animator import Animator
from facecode.bundle import Bundle
from facecode_exporter.bundles import parity
from facecode_exporter.bundles.motion_view import MotionDecoderView
from facecode_exporter.bundles.neutral import read_neutral
from facecode_exporter.bundles.speech_view import SpeechEncoderView
from facecode_exporter.bundles.views import DecoderStepView
from facecode_exporter.bundles.writer import write_bundle
from facecode_exporter.nets.speech import FAMILIES, n_frames, samples_for
from facecode_exporter.random_weights import random_network
from facecode_spec.schema import CodebookSpec
from facecode_spec.systems import SYSTEMS

TINY = SYSTEMS["codetalker-tiny"]


def resized(grid, **motion):
    """The tiny system with three heads, odd sizes and another grid."""
    part = TINY.parts[0]
    part = dataclasses.replace(
        part,
        codebook=CodebookSpec(n_codes=37, codes_per_frame=3, dim=7),
        cross_modal_decoder=dataclasses.replace(
            part.cross_modal_decoder, dim=42, n_heads=3, n_layers=3, dim_feedforward=84, period=11
        ),
        motion_decoder=dataclasses.replace(
            part.motion_decoder, n_heads=3, n_layers=1, dim_feedforward=29, **motion
        ),
    )
    encoder = dataclasses.replace(TINY.speech_encoder, frame_grid=grid)
    return dataclasses.replace(
        TINY,
        parts=(part,),
        speech_encoder=encoder,
        n_vertices=13,
        fps=25 if grid == "pairs" else 30,
    )


CASES = {
    "affine": resized("interpolate", dim=21, norm_affine=True),
    "pairs": resized("pairs", dim=33, input_projection=True, output_bias=False),
}


@pytest.fixture(scope="module", params=CASES)
def exported(request, tmp_path_factory):
    net = random_network(CASES[request.param], seed=3)
    generator = torch.Generator().manual_seed(4)
    for name, parameter in net.named_parameters():  # affine norms start at the identity
        if name.endswith("expander.0.2.weight") or name.endswith("expander.0.2.bias"):
            parameter.data += torch.randn(parameter.shape, generator=generator) / 4
    out = tmp_path_factory.mktemp("odd") / "bundle"
    neutral = read_neutral(None, net.system.n_vertices)
    manifest = write_bundle(net, out, neutral, sources={})
    return net, Animator(Bundle.open(out)), manifest


def long_speech(speech, n):
    return np.resize(speech[0], n)


@pytest.mark.parametrize("frames", [1, 2, 3, 5, 11, 12, 61])
def test_clip_lengths(exported, speech, frames):
    net, animator, _ = exported
    system = net.system
    n_samples = samples_for(system.speech_encoder, system.fps, frames)
    weights = np.array([0.5, 0.75, -0.25], np.float32)
    case = parity.compare_clip(
        net, animator.engine, parity.Case(long_speech(speech, n_samples + 17), weights)
    )
    parity.require_parity([case])
    assert case.n_frames == frames


def test_features_where_float_rounding_loses_a_frame(exported, speech):
    """205 features at 30 fps: int(205 / 50 * 30) is 122, exact arithmetic says 123."""
    net, animator, _ = exported
    audio = long_speech(speech, 65_680)
    case = parity.compare_clip(
        net, animator.engine, parity.Case(audio, np.eye(3, dtype=np.float32)[0])
    )
    parity.require_parity([case])
    assert case.n_frames == (122 if net.system.fps == 30 else 102)


def test_longer_than_600_frames(exported, speech):
    net, animator, _ = exported
    audio = long_speech(speech, 27 * 16000)
    case = parity.compare_clip(
        net, animator.engine, parity.Case(audio, np.eye(3, dtype=np.float32)[1])
    )
    parity.require_parity([case])
    assert case.n_frames == (809 if net.system.fps == 30 else 674)


def test_manifest_reports_parity_at_several_lengths(exported):
    _, _, manifest = exported
    assert [c.n_frames for c in manifest.parity.cases][:3] == [1, 2, 3]
    assert all(c.n_codes == c.n_codes_equal for c in manifest.parity.cases)
    assert set(manifest.parity.graph_errors) >= {
        "decoder_step.features", "motion_decoder.codes", "motion_decoder.feedback",
        "vertex_head.offsets",
    }  # fmt: skip


@pytest.mark.parametrize("grid", ["interpolate", "pairs"])
def test_number_of_frames_is_that_of_the_public_formula(grid):
    spec = dataclasses.replace(TINY.speech_encoder, frame_grid=grid)
    for n in (719, 720, 1040, 65_680, 131_280, 432_000):
        features = FAMILIES[spec.family].n_features(spec, n)
        want = features // 2 if grid == "pairs" else int(features / 50.0 * 30)
        assert n_frames(spec, 30, n) == want
    assert n_frames(spec, 30, 65_680) == (102 if grid == "pairs" else 122)  # not 205 * 3 // 5


def test_fused_feedback_is_the_plain_path(exported):
    """E x D product against: offsets of every vertex, then their embedding."""
    net, _, _ = exported
    view = MotionDecoderView(net)
    dim, heads, layers = net.part.motion_decoder.dim, 3, 1
    features = torch.randn(2, 9, 3, 7)
    none = torch.zeros(2, 0, dim)
    past = [torch.zeros(2, heads, 0, dim // heads)] * 2 * layers
    zeros, empty = torch.zeros(2, dim), torch.zeros(0)
    with torch.no_grad():
        _, hidden, feedback, *_ = view(
            *(features, features[:, :0], none, none, torch.arange(9)),
            *(torch.tensor(0.0), zeros, zeros, empty, empty, *past),
        )
        offsets = net.autoencoder.decode_features(features)[1]
        plain = net.vertice_map(offsets[:, -1])
    torch.testing.assert_close(feedback, plain, rtol=1e-5, atol=1e-5)
    torch.testing.assert_close(
        net.autoencoder.decoder.vertice_map_reverse(hidden), offsets, rtol=1e-5, atol=1e-5
    )


def test_cached_steps_are_the_prefix_pass(exported):
    """K/V cache, biases and precomputed cross-attention against nn.TransformerDecoder."""
    net, _, _ = exported
    view, n, batch = DecoderStepView(net), 25, 2
    dim, layers = net.part.cross_modal_decoder.dim, net.part.cross_modal_decoder.n_layers
    rows = net.system.speech_encoder.memory_rows_per_frame
    audio = torch.randn(batch, samples_for(net.system.speech_encoder, net.system.fps, n))
    style = torch.rand(batch, 3)
    motions = torch.randn(batch, n, dim)
    motions[:, 0] = 0
    with torch.no_grad():
        memory = net.memory(audio)
        assert memory.shape[1] == n * rows
        tokens = motions + (style @ net.learnable_style_emb.weight)[:, None]
        want = net.features(tokens, memory)
        cross = SpeechEncoderView(net)(audio)
        n_heads = net.part.cross_modal_decoder.n_heads
        past = [torch.zeros(batch, n_heads, 0, dim // n_heads) for _ in range(2 * layers)]
        for t in range(n):
            frame = [c[:, t] for c in cross]
            got, keys, values = view(motions[:, t], style, torch.tensor(t), *frame, *past)
            torch.testing.assert_close(got, want[:, t], rtol=1e-4, atol=1e-4)
            new = [r.reshape(batch, n_heads, 1, -1) for r in (*keys, *values)]
            past = [torch.cat(pair, dim=2) for pair in zip(past, new, strict=True)]


def test_batches_are_their_clips(exported):
    """Graphs at batch 3 give what they give clip by clip."""
    _, animator, _ = exported
    rng = np.random.default_rng(0)
    vectors = rng.standard_normal((3, 8, 3, 7)).astype(np.float32)
    motion, last = animator.engine.parts[0].motion, np.array([7])
    (together,) = motion.run(("feedback",), vectors, last)
    apart = np.concatenate([motion.run(("feedback",), v[None], last)[0] for v in vectors])
    np.testing.assert_allclose(together, apart, atol=1e-5)


@pytest.fixture
def step_inputs(exported):
    """Makes inputs of the decoder step for a batch of three, but for the past."""
    _, animator, _ = exported
    entry = animator.manifest.parts[0].decoder_step
    rng = np.random.default_rng(1)
    fixed = {
        t.name: rng.standard_normal(
            [3 if a == "batch" else int(a) for a in t.axes], dtype=np.float32
        )
        for t in entry.inputs
        if t.name != "step" and not t.name.startswith("past_")
    }

    def run(step, past):
        rows = {t.name: past[i] for i, t in enumerate(e for e in entry.inputs if "past_" in e.name)}
        names = [t.name for t in entry.outputs]
        return animator.engine.parts[0].decoder_step.run(
            names, step=np.array(step), **fixed, **rows
        )

    n_layers = animator.engine.parts[0].n_layers
    n_heads, dim = animator.engine.parts[0].n_heads, animator.engine.parts[0].dim
    past = rng.standard_normal((2 * n_layers, 3, n_heads, 22, dim // n_heads), dtype=np.float32)
    return run, past


def test_slots_are_a_ring(step_inputs):
    """Frame t stands in slot t mod n_slots: another step of the same phase is the same, rolled."""
    run, past = step_inputs
    in_order = run(44, past)
    rolled = run(33, np.roll(past, 11, axis=3))  # 11 is the period, 22 the number of slots
    for want, got in zip(in_order, rolled, strict=True):
        np.testing.assert_allclose(got, want, atol=2e-6)
    assert np.abs(run(33, past)[0] - in_order[0]).max() > 1e-3


def test_empty_slots_are_left_out(step_inputs):
    run, past = step_inputs
    for step in (0, 1, 13):
        for want, got in zip(run(step, past[:, :, :, :step]), run(step, past), strict=True):
            np.testing.assert_allclose(got, want, atol=2e-6)
