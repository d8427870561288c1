"""Several recordings on the batch axis give what they give alone; one bad one stops no other."""

import numpy as np
import pytest
import soundfile
from conftest import SPEECH, TINY

import facecode
from facecode.audio import load_audio
from facecode.errors import AudioError, AudioNotFoundError, StyleError
from facecode.loop.window import LONGEST_PAST

LENGTHS_S = (1.3, 0.2, 2.04, 0.77, 0.2)


@pytest.fixture(scope="module")
def recordings():
    speech = load_audio(SPEECH, 16_000)
    starts = np.cumsum((0, *LENGTHS_S[:-1]))
    return [
        speech[int(16_000 * start) : int(16_000 * (start + length))]
        for start, length in zip(starts, LENGTHS_S, strict=True)
    ]


@pytest.mark.parametrize("batch_size", [1, 2, 5, 8])
@pytest.mark.parametrize("window", [None, 4])
def test_a_clip_in_a_batch_is_the_clip_alone(tiny, recordings, batch_size, window):
    mode = "exact" if window is None else "window"
    many = facecode.animate_many(
        recordings, "b", face=tiny, mode=mode, window=window, batch_size=batch_size
    )
    for audio, clip in zip(recordings, many, strict=True):
        alone = tiny.animate(audio, "b", mode=mode, window=window)
        np.testing.assert_array_equal(clip.codes, alone.codes)
        np.testing.assert_allclose(clip.offsets, alone.offsets, atol=1e-5)
        np.testing.assert_array_equal(clip.audio, alone.audio)


@pytest.mark.parametrize("bundle", [TINY, None], ids=["tiny", "packaged"])
def test_long_clips_in_a_batch_are_the_clips_alone(bundle):
    """More frames than `window` looks back: the past wraps round its slots."""
    face = facecode.load(bundle)
    speech = np.resize(load_audio(SPEECH, 16_000), 22 * 16_000)
    clips = [speech, speech[16_000 : 22 * 16_000]]
    many = facecode.animate_many(clips, face=face, mode="window", window=4)
    for audio, clip in zip(clips, many, strict=True):
        assert len(clip.codes) > LONGEST_PAST
        alone = face.animate(audio, mode="window", window=4)
        np.testing.assert_array_equal(clip.codes, alone.codes)


def test_errors_stand_in_the_place_of_their_clip(tiny, recordings, tmp_path):
    broken = tmp_path / "broken.wav"
    broken.write_bytes(b"RIFF, but not for long")
    sources = [broken, recordings[0], tmp_path / "none.wav", np.zeros(3, np.float32)]
    results = list(facecode.animate_many(sources, face=tiny))
    assert isinstance(results[0], AudioError)
    np.testing.assert_array_equal(results[1].codes, tiny.animate(recordings[0]).codes)
    assert isinstance(results[2], AudioNotFoundError)
    assert isinstance(results[3], AudioError)
    assert list(facecode.animate_many([], face=tiny)) == []


def test_mistakes_that_concern_all_are_raised_before_the_first(tiny):
    with pytest.raises(StyleError):
        facecode.animate_many([], "nobody", face=tiny)
    with pytest.raises(ValueError, match="batches of 0"):
        facecode.animate_many([], face=tiny, batch_size=0)


def test_command_line(run_cli, tmp_path, recordings, tiny):
    for i, audio in enumerate(recordings[:3]):
        soundfile.write(tmp_path / f"{i}.wav", audio, 16_000, subtype="FLOAT")
    done = run_cli("animate", "0.wav", "1.wav", "2.wav", "--bundle", TINY, "--out-dir", "out")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("out: 3 of 3 recordings, 3.")
    for i, audio in enumerate(recordings[:3]):
        with np.load(tmp_path / "out" / f"{i}.npz") as talk:
            np.testing.assert_array_equal(talk["codes"], tiny.animate(audio).codes)


def test_command_line_goes_on_after_a_bad_file(run_cli, tmp_path, recordings):
    soundfile.write(tmp_path / "good.wav", recordings[0], 16_000)
    (tmp_path / "bad.wav").write_bytes(b"")
    (tmp_path / "out").mkdir()
    done = run_cli(
        "animate", "bad.wav", "missing.wav", "good.wav", "--bundle", TINY, "--out-dir", "out"
    )
    assert done.returncode == 2
    assert "bad.wav" in done.stderr
    assert "missing.wav" in done.stderr
    assert "Traceback" not in done.stderr
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["good.npz"]


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (("a.wav", "b.wav", "-o", "x.npz"), "--out-dir"),
        (("a.wav", "sub/a.wav", "--out-dir", "."), "a.npz"),
        (("a.wav", "--out-dir", "nowhere/deep"), "nowhere"),
        (("a.wav", "--out-dir", SPEECH), "cannot make the folder"),
        (("a.wav", "b.wav", "--out-dir", ".", "--samples", "2"), "alone"),
    ],
)
def test_command_line_mistakes(run_cli, args, words):
    done = run_cli("animate", *args, "--bundle", TINY)
    assert done.returncode == 2
    assert words in done.stderr
    assert "Traceback" not in done.stderr
