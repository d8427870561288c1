import io
import os
import threading
import warnings
from pathlib import Path

import numpy as np
import pytest
import soundfile
from conftest import SPEECH

from facecode.audio import load_audio
from facecode.errors import (
    AudioNotFoundError,
    AudioTooShortError,
    AudioWarning,
    EmptyAudioError,
    NonFiniteAudioError,
    UnreadableAudioError,
)
from facecode.level import normalise
from facecode.speech import require_one_frame

RATE = 16_000


def tone(rate, seconds=0.5, hz=220.0):
    return np.sin(2 * np.pi * hz * np.arange(int(rate * seconds)) / rate).astype(np.float32) / 2


@pytest.mark.parametrize("suffix", ["wav", "flac", "ogg", "mp3"])
@pytest.mark.parametrize("rate", [8_000, 16_000, 22_050, 44_100, 48_000])
@pytest.mark.parametrize("channels", [1, 2])
def test_formats_rates_and_channels(tmp_path, suffix, rate, channels):
    file = tmp_path / f"tone.{suffix}"
    soundfile.write(file, np.repeat(tone(rate)[:, None], channels, axis=1), rate)
    audio = load_audio(file, RATE)
    assert audio.dtype == np.float32
    assert audio.ndim == 1
    assert abs(len(audio) - RATE // 2) < RATE * 0.2  # mp3 pads
    middle = audio[len(audio) // 2 - 2000 : len(audio) // 2 + 2000]
    spectrum = np.abs(np.fft.rfft(middle * np.hanning(len(middle))))
    assert abs(np.argmax(spectrum) * RATE / len(middle) - 220) < 8


def test_model_rate_is_passed_through(tmp_path):
    file = tmp_path / "tone.wav"
    soundfile.write(file, tone(RATE), RATE, subtype="FLOAT")
    np.testing.assert_array_equal(load_audio(file, RATE), tone(RATE))


def test_channels_are_averaged():
    stereo = np.stack([tone(RATE), -tone(RATE)], axis=1)
    np.testing.assert_allclose(load_audio(stereo, RATE), 0, atol=1e-7)


@pytest.mark.parametrize("dtype", [np.int16, np.int32])
def test_integer_arrays_are_scaled_as_files_are(dtype):
    scale = -float(np.iinfo(dtype).min)
    audio = load_audio((tone(RATE) * scale).astype(dtype), RATE)
    np.testing.assert_allclose(audio, tone(RATE), atol=1 / 32768)


def test_array_rate_and_open_files():
    assert len(load_audio(tone(48_000), RATE, 48_000)) == RATE // 2
    assert len(load_audio(io.BytesIO(SPEECH.read_bytes()), RATE)) == 113_600


@pytest.mark.parametrize("shape", [(), (2, 2, 2)])
def test_array_shapes(shape):
    with pytest.raises(UnreadableAudioError, match="expected \\(n,\\)"):
        load_audio(np.zeros(shape, np.float32), RATE)


def test_array_dtype():
    with pytest.raises(UnreadableAudioError, match="complex128"):
        load_audio(np.zeros(9, np.complex128), RATE)


@pytest.mark.parametrize("content", [b"", b"hello", b"RIFF\0\0\0\0WAVE", bytes(2000)])
def test_not_audio(tmp_path, content):
    file = tmp_path / "noise.wav"
    file.write_bytes(content)
    with pytest.raises(UnreadableAudioError, match=r"noise\.wav is not audio"):
        load_audio(file, RATE)


@pytest.mark.parametrize("size", [1_000, 60_000])
def test_truncated_flac(tmp_path, size):
    file = tmp_path / "half.flac"
    file.write_bytes(SPEECH.read_bytes()[:size])
    with pytest.raises(UnreadableAudioError, match=r"half\.flac"):
        load_audio(file, RATE)


def test_no_such_file(tmp_path):
    with pytest.raises(AudioNotFoundError, match="does not exist"):
        load_audio(tmp_path / "none.wav", RATE)
    with pytest.raises(AudioNotFoundError, match="is a folder"):
        load_audio(tmp_path, RATE)


def test_empty(tmp_path):
    file = tmp_path / "empty.wav"
    soundfile.write(file, np.zeros(0, np.float32), RATE)
    with pytest.raises(EmptyAudioError, match="no samples"):
        load_audio(file, RATE)
    with pytest.raises(EmptyAudioError):
        load_audio(np.zeros(0, np.float32), RATE)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_non_finite(tmp_path, bad):
    samples = tone(RATE)
    samples[7] = bad
    file = tmp_path / "bad.wav"
    soundfile.write(file, samples, RATE, subtype="FLOAT")
    with pytest.raises(NonFiniteAudioError, match="1 of 8000"):
        load_audio(file, RATE)


def test_too_short():
    require_one_frame(np.zeros(720, np.float32), RATE, 720)
    with pytest.raises(AudioTooShortError, match=r"44\.9 ms long; one frame needs 45\.0 ms"):
        require_one_frame(np.zeros(719, np.float32), RATE, 720)


def test_normalise():
    x = normalise(tone(RATE) * 0.2 + 3)
    assert abs(x.mean()) < 1e-6
    assert abs(x.std() - 1) < 1e-3
    np.testing.assert_array_equal(normalise(np.zeros(100, np.float32)), 0)


def test_a_stream_without_a_length_is_read_whole(tmp_path):
    rng = np.random.default_rng(0)
    samples = (rng.standard_normal(40_001) * 3000).astype(np.int16)
    path = tmp_path / "a.flac"
    soundfile.write(path, samples, RATE)
    data = bytearray(path.read_bytes())
    assert data[:4] == b"fLaC"
    data[21] &= 0xF0  # the low 4 of the 36 bits of the number of samples
    data[22:26] = bytes(4)
    path.write_bytes(data)
    assert np.array_equal(load_audio(path, RATE), load_audio(samples, RATE))
    data[21] |= 0x0F
    data[22:26] = b"\xff" * 4  # 2^36 - 1 samples
    path.write_bytes(data)
    assert np.array_equal(load_audio(path, RATE), load_audio(samples, RATE))


def test_the_size_of_blocks_does_not_matter(tmp_path, monkeypatch):
    rng = np.random.default_rng(1)
    path = tmp_path / "a.wav"
    soundfile.write(path, rng.uniform(-1, 1, (30_011, 2)).astype(np.float32), 44_100, "FLOAT")
    whole = load_audio(path, RATE)
    for block in (1000, 4096):
        monkeypatch.setattr("facecode.audio.BLOCK", block)
        assert np.array_equal(load_audio(path, RATE), whole)


def test_pipes_and_names_in_another_encoding(tmp_path):
    data = SPEECH.read_bytes()
    want = load_audio(SPEECH, RATE)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_bytes, args=(data,))
    writer.start()
    assert np.array_equal(load_audio(pipe, RATE), want)
    writer.join()
    latin = os.fsencode(tmp_path) + b"/caf\xe9.flac"
    Path(os.fsdecode(latin)).write_bytes(data)
    assert np.array_equal(load_audio(os.fsdecode(latin), RATE), want)
    with pytest.raises(AudioNotFoundError, match=r"caf\\xe8.flac does not exist"):
        load_audio(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe8.flac"), RATE)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        (np.zeros((1, 16000), np.float32), r"transpose \(16000, 1\)"),
        (np.zeros((2, 16000), np.float32), r"transpose \(16000, 2\)"),
        (np.arange(-2000, 2000), "int64"),
        (np.arange(-2000, 2000, dtype=np.int32), "give them as int16"),
        (np.arange(-2000.0, 2000.0), "Divide samples of 16 bits by 32768"),
        (np.zeros(100, np.uint8), "uint8"),
        ([0.0] * 100_000, "type list"),
        ((16000, np.zeros(100)), "type tuple"),
        (b"RIFF", "type bytes"),
    ],
)
def test_what_means_something_else_is_refused_briefly(source, message):
    with pytest.raises(UnreadableAudioError, match=message) as caught:
        load_audio(source, RATE)
    assert len(str(caught.value)) < 300


def test_integers_of_full_scale_are_samples():
    quiet = np.zeros(100, np.int32)
    assert not load_audio(quiet, RATE).any()
    loud = np.array([0, 1 << 30, -(1 << 31)], np.int32)
    assert load_audio(loud, RATE).tolist() == [0.0, 0.5, -1.0]


def test_channels_that_cancel_are_a_warning(tmp_path):
    mono = np.sin(np.arange(16000) / 10).astype(np.float32) / 2
    with pytest.warns(AudioWarning, match="opposite phase"):
        load_audio(np.stack([mono, -mono], axis=1), RATE)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_audio(np.stack([mono, -mono * np.float32(0.9)], axis=1), RATE)
        load_audio(np.zeros((100, 2), np.float32), RATE)
