"""A stream of a bundle that normalises its speech, and windows at the ends of a recording."""

import numpy as np
import pytest

import facecode
from facecode.level import Level, RunningLevel


@pytest.fixture(scope="module")
def face(golden_bundle):
    return facecode.load(golden_bundle, threads=1)


def run(face, waveform, size):
    stream = face.stream()
    pieces = [waveform[i : i + size] for i in range(0, len(waveform), size)]
    return [f for piece in pieces for f in stream.feed(piece)] + stream.finish()


@pytest.mark.parametrize("n_samples", [1000, 9_600, 16_000, 35_001, 60_123])
def test_as_many_frames_as_the_whole_speech_at_any_cut(face, n_samples):
    """Wav2vec 2.0, 30 and 25 frames a second; frames have vertices, since there is no rig."""
    waveform = 0.1 * np.random.default_rng(n_samples).standard_normal(n_samples, np.float32)
    exact = face.animate(waveform, mode="exact")
    frames = run(face, waveform, 10**9)
    assert len(frames) == len(exact.codes)
    others = run(face, waveform, 1601)
    for one, other in zip(frames, others, strict=True):
        assert np.array_equal(one.codes, other.codes)
        assert np.array_equal(one.offsets, other.offsets)
        assert one.weights is None


def test_a_running_level_is_the_level_of_all_pieces():
    audio = 0.3 * np.random.default_rng(0).standard_normal(50_000).astype(np.float32) + 0.1
    running = RunningLevel.of(audio[:20_000]).with_more(audio[20_000:]).now
    whole = Level.of(audio)
    assert running.mean == pytest.approx(whole.mean, rel=1e-9)
    assert running.deviation == pytest.approx(whole.deviation, rel=1e-9)
    assert RunningLevel.of(np.zeros(5, np.float32)).now.apply(np.zeros(3, np.float32)).max() == 0
