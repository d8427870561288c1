import numpy as np
import pytest
import soundfile
from conftest import SPEECH, TINY

import facecode
from facecode.errors import AudioTooShortError, ModeError, StyleError, TemplateError


def test_clip(tiny):
    clip = tiny.animate(SPEECH, "b")
    assert clip.codes.shape == (212, 4)
    assert clip.codes.dtype == np.int64
    assert clip.offsets.shape == (212, 42, 3)
    assert clip.offsets.dtype == clip.vertices.dtype == np.float32
    assert clip.fps == 30
    np.testing.assert_array_equal(clip.vertices, clip.offsets + clip.template)
    assert abs(clip.duration_s - 7.07) < 0.01


def test_same_input_same_result(tiny):
    first, second = tiny.animate(SPEECH), tiny.animate(SPEECH)
    np.testing.assert_array_equal(first.codes, second.codes)
    np.testing.assert_array_equal(first.offsets, second.offsets)


def test_path_array_and_open_file_agree(tiny, speech):
    samples, rate = speech
    want = tiny.animate(SPEECH).codes
    with SPEECH.open("rb") as file:
        np.testing.assert_array_equal(tiny.animate(file).codes, want)
    np.testing.assert_array_equal(tiny.animate(str(SPEECH)).codes, want)
    np.testing.assert_array_equal(tiny.animate(samples, sample_rate=rate).codes, want)


def test_styles_differ_and_mix(tiny):
    a, b = tiny.animate(SPEECH, "a"), tiny.animate(SPEECH, "b")
    mixed = tiny.animate(SPEECH, {"a": 1.0, "b": 0.0})
    assert not np.array_equal(a.codes, b.codes)
    np.testing.assert_array_equal(mixed.codes, a.codes)


def test_one_frame(tiny, speech):
    clip = tiny.animate(speech[0][:720])
    assert clip.vertices.shape == (1, 42, 3)
    assert np.isfinite(clip.vertices).all()
    with pytest.raises(AudioTooShortError):
        tiny.animate(speech[0][:719])


def test_silence(tiny):
    clip = tiny.animate(np.zeros(16_000, np.float32))
    assert clip.vertices.shape[0] == 29
    assert np.isfinite(clip.vertices).all()


def test_own_template(tiny, tmp_path):
    template = tiny.bundle.template * np.float32(1.25) + np.float32(0.5)
    np.save(tmp_path / "face.npy", template)
    clip = tiny.animate(SPEECH, template=tmp_path / "face.npy")
    np.testing.assert_array_equal(clip.template, template)
    np.testing.assert_array_equal(clip.offsets, tiny.animate(SPEECH).offsets)
    with pytest.raises(TemplateError, match="42"):
        tiny.animate(SPEECH, template=template[:-1])


def test_head_chunks_do_not_show(tiny, monkeypatch):
    want = tiny.animate(SPEECH).offsets
    monkeypatch.setattr("facecode.loop.part.HEAD_CHUNK", 7)
    np.testing.assert_allclose(tiny.animate(SPEECH).offsets, want, atol=1e-6)


def test_mistakes(tiny):
    with pytest.raises(StyleError):
        tiny.animate(SPEECH, "nobody")
    with pytest.raises(ModeError):
        tiny.animate(SPEECH, mode="fast")
    with pytest.raises(ValueError, match="0 threads"):
        facecode.load(TINY, threads=0)


def test_auto_is_exact_for_short_speech_and_window_for_long():
    tiny = facecode.load(TINY, threads=1)
    samples, _ = soundfile.read(SPEECH, dtype="float32")
    for n, mode in ((15 * 16000, "exact"), (15 * 16000 + 1, "window")):
        audio = np.resize(samples, n)
        clip, want = tiny.animate(audio), tiny.animate(audio, mode=mode)
        assert (clip.mode, want.mode) == (mode, mode)
        assert np.array_equal(clip.codes, want.codes)
        assert np.array_equal(clip.offsets, want.offsets)
        assert tiny.blocks(audio, mode="auto").still.mode == mode
    assert tiny.animate(samples, window=8).mode == "window"


def test_a_batch_may_hold_both():
    tiny = facecode.load(TINY, threads=1)
    samples, _ = soundfile.read(SPEECH, dtype="float32")
    sources = [samples[:40000], np.resize(samples, 16 * 16000), samples[:30000]]
    clips = list(facecode.animate_many(sources, face=tiny))
    assert [clip.mode for clip in clips] == ["exact", "window", "exact"]
    for clip, source in zip(clips, sources, strict=True):
        assert np.array_equal(clip.codes, tiny.animate(source).codes)
