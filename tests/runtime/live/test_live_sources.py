"""Samples out of a pipe, and a microphone that stops."""

import io
import sys
import types

import numpy as np
import pytest

from facecode.errors import MicrophoneError, MissingExtraError
from facecode.live.sources import microphone_chunks, pipe_chunks


class Dribble(io.RawIOBase):
    """Gives a few bytes at a time, as a slow pipe does."""

    def __init__(self, data, sizes):
        self.data, self.sizes = data, list(sizes)

    def read1(self, _):
        n = self.sizes.pop(0) if self.sizes else len(self.data)
        piece, self.data = self.data[:n], self.data[n:]
        return piece


@pytest.mark.parametrize(("name", "dtype"), [("s16", "<i2"), ("f32", "<f4")])
def test_a_pipe_may_cut_samples_anywhere(name, dtype):
    samples = np.arange(60).reshape(-1, 2).astype(dtype)
    pipe = Dribble(samples.tobytes() + b"\x01", [1, 2, 3, 5, 1, 1, 7])
    chunks = list(pipe_chunks(pipe, name, 2))
    assert all(len(chunk) and chunk.shape[1] == 2 for chunk in chunks)
    assert np.array_equal(np.concatenate(chunks), samples)
    assert list(pipe_chunks(io.BytesIO(), name, 2)) == []


class FakeInput:
    """Three chunks, then the device is gone."""

    def __init__(self, *, callback, finished_callback, blocksize, **options):
        if options["device"] == "absent":
            raise ValueError("no input device matching 'absent'")
        self.run = lambda: [callback(np.full((blocksize, 1), i, "f4"), None) for i in range(3)]
        self.ended, self.closed = finished_callback, False

    def start(self):
        self.run()
        self.ended()

    def close(self):
        self.closed = True


@pytest.fixture
def sounddevice(monkeypatch):
    module = types.ModuleType("sounddevice")
    module.InputStream = FakeInput
    module.PortAudioError = type("PortAudioError", (Exception,), {})
    monkeypatch.setitem(sys.modules, "sounddevice", module)
    return module


def test_a_microphone_that_vanishes_is_an_error_after_its_last_chunk(sounddevice):
    heard = []

    def listen():
        with microphone_chunks(16_000) as chunks:
            for chunk, waiting_s in chunks:
                heard.append((chunk.shape, float(chunk[0, 0]), round(waiting_s, 2)))

    with pytest.raises(MicrophoneError, match="plugged"):
        listen()
    assert heard == [((320, 1), 0.0, 0.06), ((320, 1), 1.0, 0.04), ((320, 1), 2.0, 0.02)]


def test_no_such_microphone(sounddevice):
    with pytest.raises(MicrophoneError, match="--device"), microphone_chunks(16_000, "absent"):
        pass


def test_without_sounddevice(monkeypatch):
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    with pytest.raises(MissingExtraError, match=r"'\.\[live\]'"), microphone_chunks(16_000):
        pass
