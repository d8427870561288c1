"""A stream gives the same frames however its speech is cut, and what mode `live` gives."""

import threading

import numpy as np
import pytest
import soxr
from conftest import SPEECH

import facecode
from facecode.audio import load_audio
from facecode.errors import (
    LookAheadError,
    ModeError,
    NonFiniteAudioError,
    NoRigError,
    SampleError,
    StreamEndedError,
    StreamRateError,
    UnreadableAudioError,
)

RATE = 44_100


@pytest.fixture(scope="module")
def face():
    return facecode.load(threads=1)


@pytest.fixture(scope="module")
def wave():
    """2.5 s of speech at a rate that is not the bundle's."""
    return soxr.resample(load_audio(SPEECH, 16_000)[:40_000], 16_000, RATE)


def cut(samples, sizes):
    """Pieces of the sizes in turn, until nothing is left."""
    start, turn = 0, 0
    while start < len(samples):
        size = sizes[turn % len(sizes)]
        yield samples[start : start + size]
        start, turn = start + size, turn + 1


def run(stream, samples, sizes=(10**9,), rate=RATE):
    frames = [f for piece in cut(samples, sizes) for f in stream.feed(piece, rate)]
    return frames + stream.finish()


def same(frames, others):
    assert len(frames) == len(others) > 0
    for one, other in zip(frames, others, strict=True):
        assert (one.index, one.time_s) == (other.index, other.time_s)
        for name in ("codes", "weights", "offsets"):
            a, b = getattr(one, name), getattr(other, name)
            assert (a is None) == (b is None)
            assert a is None or np.array_equal(a, b), (name, one.index)


@pytest.fixture(scope="module")
def whole(face, wave):
    return run(face.stream("calm", vertices=True), wave)


@pytest.mark.parametrize("sizes", [(882,), (1, 0, 30_000), (4410, 7, 2000, 1, 1), (44_099,)])
def test_frames_do_not_depend_on_the_cut(face, wave, whole, sizes):
    same(run(face.stream("calm", vertices=True), wave, sizes), whole)


def test_single_samples(face, wave, whole):
    stream = face.stream("calm", vertices=True)
    frames = [f for piece in cut(wave[:20_000], (1,)) for f in stream.feed(piece, RATE)]
    same(frames, whole[: len(frames)])


def test_mode_live_gives_the_frames_of_a_stream(face, wave, whole):
    clip = face.animate(wave, "calm", mode="live", sample_rate=RATE)
    assert clip.mode == "live"
    assert np.array_equal(clip.codes, np.stack([f.codes for f in whole]))
    assert np.array_equal(clip.weights, np.stack([f.weights for f in whole]))
    assert np.array_equal(clip.offsets, np.stack([f.offsets for f in whole]))
    alone = face.animate(wave, "calm", mode="live", sample_rate=RATE, vertices=False)
    assert np.array_equal(alone.weights, clip.weights)


def test_blocks_and_many_take_the_mode_too(face, wave, whole):
    codes = np.stack([f.codes for f in whole])
    (block,) = face.blocks(wave, "calm", mode="live", sample_rate=RATE)
    assert np.array_equal(block.codes, codes)
    good, bad = facecode.animate_many(
        [wave, np.full(9, np.nan, np.float32)], "calm", face=face, mode="live", sample_rate=RATE
    )
    assert np.array_equal(good.codes, codes)
    assert isinstance(bad, NonFiniteAudioError)


def test_another_look_ahead_is_another_face_and_the_same_length(face, wave, whole):
    near, far = (
        face.animate(wave, "calm", mode="live", sample_rate=RATE, look_ahead_ms=ms, vertices=False)
        for ms in (100, 400)
    )
    assert len(near.codes) == len(far.codes) == len(whole)
    assert not np.array_equal(near.codes, far.codes)


def test_more_look_ahead_is_nearer_to_the_whole_speech(face):
    wave = load_audio(SPEECH, 16_000)
    exact = face.animate(wave, mode="exact", vertices=False).weights
    errors = [
        np.abs(
            face.animate(wave, mode="live", look_ahead_ms=ms, vertices=False).weights - exact
        ).mean()
        for ms in (100, 200, 400)
    ]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 0.03


def test_streams_in_turns_and_in_threads_give_what_they_give_alone(face, wave, whole):
    one, other = face.stream("calm", vertices=True), face.stream("lively", vertices=True)
    alone = run(face.stream("lively", vertices=True), wave)
    found = [[], []]
    for piece in cut(wave, (5000,)):
        found[0] += one.feed(piece, RATE)
        found[1] += other.feed(piece, RATE)
    same(found[0] + one.finish(), whole)
    same(found[1] + other.finish(), alone)

    results = {}
    streams = {style: face.stream(style, vertices=True) for style in ("calm", "lively")}
    threads = [
        threading.Thread(target=lambda s=s: results.update({s: run(streams[s], wave, (3000,))}))
        for s in streams
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    same(results["calm"], whole)
    same(results["lively"], alone)


def test_integers_and_channels(face, wave, whole):
    pcm = (wave * 32768).clip(-32768, 32767).astype(np.int16)
    mono = run(face.stream("calm", vertices=True), pcm)
    stereo = run(face.stream("calm", vertices=True), np.stack([pcm, pcm], axis=1), (700,))
    same(mono, stereo)
    assert np.abs(mono[20].weights - whole[20].weights).max() < 0.1


def test_reset_begins_anew(face, wave, whole):
    stream = face.stream("calm", vertices=True)
    stream.feed(wave[:20_000], RATE)
    stream.reset()
    same(run(stream, wave), whole)
    with pytest.raises(StreamEndedError, match="reset"):
        stream.feed(wave[:10])
    with pytest.raises(StreamEndedError):
        stream.flush()
    stream.reset()
    same(run(stream, wave, (9999,)), whole)


def test_flush_gives_all_that_was_heard_and_goes_on(face, wave):
    def run_in_two(sizes):
        stream = face.stream()
        first = [f for p in cut(wave[:30_000], sizes) for f in stream.feed(p, RATE)]
        first += stream.flush()
        assert stream.flush() == []
        return first, [
            f for p in cut(wave[30_000:], sizes) for f in stream.feed(p)
        ] + stream.finish()

    first, second = run_in_two((10**9,))
    assert len(first) / 30 >= 30_000 / RATE
    assert len(first) / 30 < 30_000 / RATE + 0.1 + 1e-6
    assert [f.index for f in first + second] == list(range(len(first + second)))
    for got, expected in zip(run_in_two((777,)), (first, second), strict=True):
        same(got, expected)


def test_skip_leaves_frames_out_and_keeps_the_time(face, wave):
    def skip_some(sizes):
        stream = face.stream()
        frames = stream.feed(wave[:40_000], RATE)
        for piece in cut(wave[40_000:70_000], sizes):
            frames += stream.skip(piece, RATE)
        frames += stream.feed(wave[70_000:]) + stream.finish()
        return stream, frames

    stream, frames = skip_some((10**9,))
    missing = sorted(set(range(frames[-1].index + 1)) - {f.index for f in frames})
    assert stream.n_skipped == len(missing) > 0
    assert missing == list(range(missing[0], missing[-1] + 1))
    assert frames[-1].index == len(run(face.stream(), wave)) - 1
    again, others = skip_some((1000,))
    same(others, frames)
    assert again.n_skipped == stream.n_skipped


def test_styles_blend(face, wave):
    def change(sizes):
        stream = face.stream("calm")
        frames = [f for p in cut(wave[:40_000], sizes) for f in stream.feed(p, RATE)]
        stream.restyle({"lively": 1.0}, blend_s=0.4)
        frames += [f for p in cut(wave[40_000:], sizes) for f in stream.feed(p, RATE)]
        return frames + stream.finish()

    changed, calm = change((10**9,)), run(face.stream("calm"), wave)
    same(change((500,)), changed)
    before = [np.array_equal(a.codes, b.codes) for a, b in zip(changed, calm, strict=True)]
    assert all(before[:15])
    assert not all(before)
    with pytest.raises(facecode.errors.StyleError):
        face.stream("calm").restyle("clam")
    with pytest.raises(ValueError, match="blend"):
        face.stream("calm").restyle("calm", blend_s=-1)


def test_what_is_refused_is_not_taken(face, wave, whole):
    stream = face.stream("calm", vertices=True)
    for bad, error in (
        (np.array([0, np.nan], np.float32), NonFiniteAudioError),
        (np.array([300.0]), UnreadableAudioError),
        (np.zeros((2, 3, 4)), UnreadableAudioError),
        (np.array(["a"]), UnreadableAudioError),
    ):
        with pytest.raises(error):
            stream.feed(bad, RATE)
    frames = stream.feed(wave[:5000], RATE)
    with pytest.raises(StreamRateError, match="44100"):
        stream.feed(wave[:10], 48_000)
    same(frames + stream.feed(wave[5000:]) + stream.finish(), whole)
    for rate in (-1, 10**9):
        with pytest.raises(StreamRateError):
            face.stream().feed(wave[:10], rate)


def test_what_does_not_go_with_a_stream(face, wave, tiny):
    for ms in (0, 99, 1e9, float("nan")):
        with pytest.raises(LookAheadError):
            face.stream(look_ahead_ms=ms)
    with pytest.raises(ModeError, match="look-ahead"):
        face.animate(wave, look_ahead_ms=200)
    with pytest.raises(ModeError, match="one face"):
        face.animate(wave, mode="live", samples=2)
    with pytest.raises(SampleError):
        face.stream(sample=1)
    with pytest.raises(NoRigError):
        tiny.animate(wave, mode="live", vertices=False)


def test_less_than_a_frame(face):
    assert face.stream().finish() == []
    assert face.stream().flush() == []
    with pytest.raises(facecode.errors.AudioTooShortError):
        face.animate(np.zeros(100, np.float32), mode="live")


def test_a_sample_of_a_diverse_bundle(wave):
    face = facecode.load("diverse", threads=1)
    first, third = (run(face.stream(sample=k), wave[:30_000]) for k in (0, 2))
    assert not np.array_equal(first[9].codes, third[9].codes)
    same(run(face.stream(sample=2), wave[:30_000], (1234,)), third)


def test_latency_is_stated(face):
    assert face.stream().latency_ms == pytest.approx(200 + 100 + 1000 / 30)
    assert face.stream(look_ahead_ms=100).latency_ms == pytest.approx(100 + 100 + 1000 / 30)
