"""Thin layers over a stream give its frames; what falls behind is left out and counted."""

import asyncio

import numpy as np
import pytest

import facecode
from facecode.audio import SPEECH, load_audio
from facecode.live.drive import for_each_frame, frames_of, frames_of_async, keep_up


@pytest.fixture(scope="module")
def face():
    return facecode.load(threads=1)


@pytest.fixture(scope="module")
def chunks():
    wave = load_audio(SPEECH, 16_000)[:24_000]
    return [wave[i : i + 3200] for i in range(0, len(wave), 3200)]


@pytest.fixture(scope="module")
def expected(face, chunks):
    stream = face.stream()
    return [f for chunk in chunks for f in stream.feed(chunk)] + stream.finish()


def same(frames, others):
    assert len(frames) == len(others)
    assert all(np.array_equal(a.weights, b.weights) for a, b in zip(frames, others, strict=True))


def test_a_loop_a_callback_and_asyncio(face, chunks, expected):
    same(list(frames_of(face.stream(), chunks)), expected)
    shown = []
    for_each_frame(face.stream(), chunks, shown.append)
    same(shown, expected)

    async def speak():
        for chunk in chunks:
            await asyncio.sleep(0)
            yield chunk

    async def listen():
        return [frame async for frame in frames_of_async(face.stream(), speak())]

    same(asyncio.run(listen()), expected)


def test_keeping_up(face, chunks, expected):
    same(list(keep_up(face.stream(), ((c, 0.1) for c in chunks), 16_000)), expected)
    stream = face.stream()
    late = [(c, 0.9 if 2 <= i < 5 else 0.0) for i, c in enumerate(chunks)]
    frames = list(keep_up(stream, late, 16_000))
    assert stream.n_skipped > 0
    assert len(frames) + stream.n_skipped == len(expected)
    assert frames[-1].index == expected[-1].index
