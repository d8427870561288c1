"""In quiet the face rests and blinks; in speech nothing changes."""

import dataclasses
import math

import numpy as np
import pytest

import facecode
from facecode.audio import SPEECH, load_audio
from facecode.live.rest import Blinks, RestGate, loudness_db
from facecode.live.stream import Stream

RATE, FPS = 16_000, 30.0


@pytest.fixture(scope="module")
def face():
    return facecode.load(threads=1)


def noise(seconds, db, colour, seed=0):
    """Steady noise of a level in dBFS; its power falls by `colour` with the frequency."""
    n = int(seconds * RATE)
    spectrum = np.fft.rfft(np.random.default_rng(seed).standard_normal(n))
    spectrum /= np.maximum(np.arange(len(spectrum)), 20) ** colour
    wave = np.fft.irfft(spectrum, n)
    return (wave / np.sqrt(np.square(wave).mean()) * 10 ** (db / 20)).astype(np.float32)


def weights_of(stream, wave):
    return np.stack([frame.weights for frame in stream.feed(wave, RATE) + stream.finish()])


@pytest.mark.parametrize(("db", "colour"), [(-60, 0.5), (-50, 0), (-30, 0), (-30, 0.5), (-30, 1)])
def test_room_tone_leaves_the_face_at_rest(face, db, colour):
    weights = weights_of(face.stream(rest_in_quiet=True), noise(20, db, colour))
    names = face.bundle.rig.names
    lids = [names.index("eyeBlinkLeft"), names.index("eyeBlinkRight")]
    others = np.delete(weights, lids, axis=1)
    assert (others[30:].max(axis=1) > 0.15).mean() <= 0.02
    closed = weights[:, lids[0]] > 0.5
    n_blinks = (closed[1:] & ~closed[:-1]).sum()
    assert 20 / 60 * 8 <= n_blinks <= 20 / 60 * 25


def test_digital_silence(face):
    weights = weights_of(face.stream(rest_in_quiet=True), np.zeros(5 * RATE, np.float32))
    assert (weights[15:].max(axis=1) > 0.15).mean() < 0.2  # blinks alone


def test_speech_is_left_alone(face):
    wave = load_audio(SPEECH, RATE)[RATE // 2 : 6 * RATE]
    plain = weights_of(face.stream(), wave)
    gated = weights_of(face.stream(rest_in_quiet=True), wave)
    spoken = plain.max(axis=1) > 0.3
    same = np.abs(plain - gated).max(axis=1) < 1e-6
    assert same[spoken].mean() > 0.97


def test_offsets_rest_and_blink_as_the_weights_do(face):
    stream = face.stream(rest_in_quiet=True, vertices=True)
    frames = stream.feed(noise(8, -40, 0.5), RATE) + stream.finish()
    deltas = face.bundle.rig.deltas
    late = [f for f in frames if f.index > 60]
    for frame in late:
        wanted = np.einsum("k,kvc->vc", frame.weights, deltas)
        assert np.abs(frame.offsets - wanted).max() < 1e-3
    assert max(np.abs(f.offsets).max() for f in late) > 2e-3, "eyelids move"


def test_a_rig_that_gives_no_weights_still_blinks(face):
    stream = face.stream(rest_in_quiet=True, vertices=True)
    voice = dataclasses.replace(stream._voice, problem=None)
    frames = Stream(voice).feed(noise(1, -40, 0), RATE)
    assert frames[0].weights is None
    assert frames[0].offsets.shape == face.bundle.template.shape


def test_the_gate_opens_before_a_word_and_closes_after_it():
    gate = RestGate(FPS)
    quiet, word = [-50.0] * 4, [-20.0] * 4
    assert [gate.next(quiet) for _ in range(60)][-1] == 0
    opening = [gate.next([-50.0, -50.0, -20.0, -20.0]), *(gate.next(word) for _ in range(3))]
    assert opening == sorted(opening)
    assert opening[-1] == 1
    closing = [gate.next(quiet) for _ in range(30)]
    assert closing[8] == 1, "held for pauses between words"
    assert closing[-1] == 0


def test_loudness():
    assert loudness_db(np.zeros(100, np.float32)) == -math.inf
    assert loudness_db(np.zeros(0, np.float32)) == -math.inf
    soft, loud = (loudness_db(noise(0.1, db, 0)) for db in (-40, -20))
    assert loud - soft == pytest.approx(20, abs=0.1)


def test_blinks_are_the_same_every_time_and_close_the_lids():
    names = ("jawOpen", "eyeBlinkLeft", "eyeBlinkRight")
    one, other = Blinks(names, FPS), Blinks(names, FPS)
    seen = np.stack([one.next(0.0) for _ in range(900)])
    assert np.array_equal(seen, np.stack([other.next(0.0) for _ in range(900)]))
    assert seen[:, 0].max() == 0
    assert seen[:, 1].max() > 0.7
    assert np.array_equal(seen[:, 1], seen[:, 2])
    never = Blinks(names, FPS)
    assert max(never.next(1.0).max() for _ in range(900)) == 0
