"""The speech of a clip as a sound file."""

import io

import numpy as np
import pytest
import soundfile
from small_faces import rigged

from facecode.writers.sound import BLOCK, speech_of


@pytest.mark.parametrize("kind", ["FLAC", "WAV"])
def test_every_sample_to_16_bits(kind):
    samples = np.random.default_rng(0).uniform(-1.2, 1.2, 2 * BLOCK + 77).astype(np.float32)
    made = speech_of(rigged(audio=samples, sample_rate=16_000), kind)
    found, rate = soundfile.read(io.BytesIO(made), dtype="float32")
    info = soundfile.info(io.BytesIO(made))
    assert (rate, info.format, info.subtype) == (16_000, kind, "PCM_16")
    assert np.abs(found - np.clip(samples, -1, 1)).max() <= 2**-14
    whole = io.BytesIO()
    soundfile.write(whole, np.clip(samples, -1, 1 - 2**-15), 16_000, "PCM_16", format=kind)
    assert made == whole.getvalue()


def test_no_speech_is_no_file():
    assert speech_of(rigged(), "FLAC") is None
