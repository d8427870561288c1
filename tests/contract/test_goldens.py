"""The promise: codes equal to the public code's, vertices within 1e-4."""

import numpy as np
import pytest
import torch

import facecode
from facecode_exporter.checkpoints import load_system
from facecode_exporter.config import system_from_config
from facecode_spec.graphs import VERTICES


def mix_text(mix):
    return ",".join(f"{name}:{weight}" for name, weight in mix.items())


def check(codes, vertices, golden, i):
    want_codes, want_vertices = golden.expected(i)
    np.testing.assert_array_equal(codes, want_codes)
    np.testing.assert_allclose(vertices, want_vertices, rtol=0, atol=VERTICES.atol)


@pytest.mark.parametrize("i", [0, 1])
def test_torch_networks(golden, i):
    system = system_from_config(golden.config, golden.wav2vec2)
    net = load_system(system, [golden.stage1], [golden.stage2])
    with np.load(golden.folder / "input_values.npz") as arrays:
        audio = torch.from_numpy(arrays[arrays.files[0]]).reshape(1, -1)
    mix = golden.styles()[i]
    weights = torch.tensor([[mix.get(name, 0.0) for name in system.styles]])
    truth = net.predict(audio, weights)
    vertices = truth.offsets[0].numpy() + np.load(golden.template)
    check(truth.codes[0].numpy(), vertices, golden, i)


@pytest.mark.parametrize("i", [0, 1])
def test_runtime_from_python(golden, golden_bundle, i):
    clip = facecode.load(golden_bundle).animate(golden.speech, golden.styles()[i])
    check(clip.codes, clip.vertices, golden, i)


@pytest.mark.parametrize("i", [0, 1])
def test_runtime_from_the_command_line(golden, golden_bundle, run_cli, tmp_path, i):
    style = mix_text(golden.styles()[i])
    done = run_cli(
        "animate", golden.speech, "--bundle", golden_bundle, "-o", "talk.npz", "--style", style
    )
    assert done.returncode == 0, done.stderr
    with np.load(tmp_path / "talk.npz") as talk:
        check(talk["codes"], talk["vertices"], golden, i)
        assert talk["vertices"].dtype == np.float32


def test_codes_do_not_depend_on_threads_or_runs(golden, golden_bundle):
    clips = [
        facecode.load(golden_bundle, threads=threads).animate(golden.speech)
        for threads in (1, 2, 3, 2)
    ]
    for clip in clips[1:]:
        np.testing.assert_array_equal(clip.codes, clips[0].codes)
        np.testing.assert_allclose(clip.offsets, clips[0].offsets, rtol=0, atol=1e-5)


def test_window_as_long_as_the_clip_is_exact(golden, golden_bundle):
    face = facecode.load(golden_bundle)
    exact = face.animate(golden.speech)
    window = face.animate(golden.speech, mode="window", window=len(exact.codes))
    np.testing.assert_array_equal(window.codes, exact.codes)
    short = face.animate(golden.speech, mode="window", window=3)
    assert short.offsets.shape == exact.offsets.shape
    assert not np.array_equal(short.offsets, exact.offsets)  # the window is really used


def test_normalised_audio_is_that_of_the_public_code(golden):
    from facecode.audio import load_audio
    from facecode.level import normalise

    with np.load(golden.folder / "input_values.npz") as arrays:
        want = arrays[arrays.files[0]].ravel()
    np.testing.assert_allclose(normalise(load_audio(golden.speech, 16000)), want, atol=2e-6)
