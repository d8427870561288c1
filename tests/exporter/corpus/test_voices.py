"""Voices: reproducible, and different where they should be."""

import numpy as np
import pytest

from facecode_exporter.corpus.prosody import frame_windows
from facecode_exporter.corpus.voices import VOICES, Voice, _warped, available_voices, speak
from facecode_exporter.errors import CorpusError

TEXT = "My brother moved the piano."
PLAIN = Voice("plain", "hibari")


@pytest.fixture(scope="module", autouse=True)
def _needs_hibari():
    pytest.importorskip("hibari", reason="needs the extra corpus")


def pitch_hz(audio):
    """The median over loud frames of the strongest lag of the autocorrelation."""
    windows = frame_windows(audio, int(len(audio) / 16000 * 30), 30)
    loud = windows[np.square(windows).mean(axis=1) > 0.2 * np.square(windows).mean(axis=1).max()]
    spectra = np.abs(np.fft.rfft(loud, 2048, axis=1)) ** 2
    lags = np.fft.irfft(spectra, axis=1)[:, 40:250].argmax(axis=1) + 40
    return 16000 / np.median(lags)


def test_names_are_unique_and_some_voices_are_for_the_test_only():
    assert len({voice.name for voice in VOICES}) == len(VOICES)
    assert 0 < sum(voice.held_out for voice in VOICES) < len(VOICES) / 2


def test_the_same_seed_gives_the_same_sound():
    first, second, other = (speak(TEXT, PLAIN, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, second)
    assert first.dtype == np.float32
    assert np.abs(first - other).max() > 1e-4


def test_pitch_and_pace_are_factors():
    plain, low = speak(TEXT, PLAIN, 1), speak(TEXT, Voice("low", "hibari", pitch=0.6), 1)
    assert pitch_hz(low) / pitch_hz(plain) == pytest.approx(0.6, rel=0.12)
    fast = speak(TEXT, PLAIN, 1, pace=1.5)
    assert len(fast) < 0.8 * len(plain)


def test_warping_moves_a_resonance():
    spectrum = np.zeros((601, 2), np.float32)
    spectrum[200] = 1
    assert _warped(spectrum, 0.9).argmax(axis=0).tolist() == [180, 180]
    np.testing.assert_array_equal(_warped(spectrum, 1.0), spectrum)


def test_flite_speaks_where_it_is_installed():
    flite = [voice for voice in available_voices() if voice.source == "flite"]
    if not flite:
        pytest.skip("the program flite is not installed")
    assert len(speak(TEXT, flite[0], 0)) > 16000


def test_a_missing_flite_is_named(monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert {voice.source for voice in available_voices()} == {"hibari"}
    with pytest.raises(CorpusError, match="install the Debian package flite"):
        speak(TEXT, Voice("slt", "flite"), 0)
