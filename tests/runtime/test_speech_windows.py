"""Long audio: windows with context, one held at a time, frames where one pass has them."""

import numpy as np
import pytest

from facecode import speech as module
from facecode.level import Level, normalise
from facecode.speech import LongMemory, WholeMemory


def shorten(monkeypatch):
    for name, seconds in (("KEPT_S", 2), ("CONTEXT_S", 1), ("LONGEST_S", 4)):
        monkeypatch.setattr(module, name, seconds)


@pytest.fixture
def short_windows(monkeypatch):
    shorten(monkeypatch)


@pytest.mark.parametrize("seconds", [4.01, 5.0, 6.02, 7.98])
def test_windows_give_as_many_frames_as_one_pass(tiny, speech, monkeypatch, seconds):
    audio = np.resize(speech[0], int(16000 * seconds))
    whole = tiny.engine.encode(audio)
    assert isinstance(whole, WholeMemory)
    shorten(monkeypatch)
    windows = tiny.engine.encode(audio)
    assert isinstance(windows, LongMemory)
    assert abs(windows.n_frames - whole.n_frames) <= 1
    for step in range(windows.n_frames):
        (rows,) = windows.frame(step).values()
        assert rows.shape == whole.frame(0)["cross_output"].shape


def test_up_to_the_threshold_it_is_one_pass(tiny, speech, short_windows):
    assert isinstance(tiny.engine.encode(np.resize(speech[0], 64000)), WholeMemory)
    assert isinstance(tiny.engine.encode(np.resize(speech[0], 64001)), LongMemory)


def test_one_window_is_held_at_a_time(tiny, speech, short_windows):
    memory = tiny.engine.encode(np.resize(speech[0], 16000 * 30))
    held = set()
    for step in range(memory.n_frames):
        memory.frame(step)
        held.add(memory._window.n_frames)
    assert max(held) <= 4 * 30


def test_level_is_that_of_the_whole_clip(speech, monkeypatch):
    audio = speech[0]
    monkeypatch.setattr("facecode.level.BLOCK", 1000)
    level = Level.of(audio)
    np.testing.assert_allclose(level.mean, audio.mean(dtype=np.float64), atol=1e-12)
    whole = normalise(audio)
    np.testing.assert_array_equal(level.apply(audio[5000:7000]), whole[5000:7000])
