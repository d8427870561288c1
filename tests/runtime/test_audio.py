import io

import numpy as np
import pytest
import soundfile
from conftest import SPEECH

from facecode.audio import load_audio, normalise, require_one_frame
from facecode.errors import (
    AudioNotFoundError,
    AudioTooShortError,
    EmptyAudioError,
    NonFiniteAudioError,
    UnreadableAudioError,
)

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
