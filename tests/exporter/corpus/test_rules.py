"""Labels: the same every time, closed when lips must close, open when they must open."""

import itertools

import numpy as np
import pytest

from facecode_exporter.corpus.phones import SAMPLE_RATE
from facecode_exporter.corpus.rules import FPS, face_weights, frames_in
from facecode_exporter.corpus.styles import STYLES, style_named
from facecode_exporter.corpus.visemes import ALIKE, DIPHTHONGS, VISEMES, VOWELS, split_diphthongs
from facecode_exporter.errors import AlignmentError
from facecode_exporter.head.face_units import UNIT
from facecode_exporter.head.head import load_head
from facecode_exporter.measures.lip_sync import count_lip_sync
from facecode_exporter.measures.phone import SILENCE, Phone

ARPABET = {*VOWELS, SILENCE}.union(
    *(
        ["B", "CH", "D", "DH", "F", "G", "HH", "JH", "K", "L", "M"],
        ["N", "NG", "P", "R", "S", "SH", "T", "TH", "V", "W", "Y", "Z", "ZH"],
    )
)


@pytest.fixture(scope="module")
def head():
    return load_head()


def said(names, length_s=0.1, silence_s=0.5):
    """Phones of one length between two silences."""
    lengths = [silence_s] + [length_s] * len(names) + [silence_s]
    ends = list(itertools.accumulate(lengths))
    starts = [0.0, *ends[:-1]]
    return [Phone(*row) for row in zip([SILENCE, *names, SILENCE], starts, ends, strict=True)]


def sound(phones):
    """A buzz while something is said."""
    n = round(phones[-1].end_s * SAMPLE_RATE)
    t = np.arange(n) / SAMPLE_RATE
    audio = 0.2 * np.sign(np.sin(2 * np.pi * 120 * t)).astype(np.float32)
    for name, start_s, end_s in phones:
        if name == SILENCE:
            audio[round(start_s * SAMPLE_RATE) : round(end_s * SAMPLE_RATE)] = 0
    return audio


def label(names, style="calm", seed=0, **lengths):
    phones = said(names, **lengths)
    return phones, face_weights(sound(phones), phones, style_named(style), seed)


def rest_of(head):
    return float(head.opening(np.zeros((1, 52)))[0])


def during(values, phone):
    return values[int(phone.start_s * FPS) : int(phone.end_s * FPS) + 1]


@pytest.mark.parametrize("phone", sorted(ARPABET))
def test_every_phone_has_a_viseme(phone):
    parts = split_diphthongs([Phone(phone, 1.0, 1.3)])
    assert {part.name for part in parts} <= set(VISEMES)
    assert (parts[0].start_s, pytest.approx(parts[-1].end_s)) == (1.0, 1.3)


def test_tables_name_visemes_that_exist():
    assert set(ALIKE.values()) <= set(VISEMES)
    assert {part for row in DIPHTHONGS.values() for part, _ in row} <= set(VISEMES)
    assert all(sum(share for _, share in row) == 1 for row in DIPHTHONGS.values())


def test_style_names_are_file_name_parts():
    assert len({style.name for style in STYLES}) == len(STYLES) >= 6
    assert all(style.name.isalpha() for style in STYLES)


def test_the_same_seed_gives_the_same_label():
    for style in STYLES:
        _, first = label(["M", "AA", "M", "AH"], style.name, seed=7)
        _, second = label(["M", "AA", "M", "AH"], style.name, seed=7)
        np.testing.assert_array_equal(first, second)


def test_the_seed_changes_the_upper_face_and_leaves_the_mouth():
    _, first = label(["B", "EH", "T", "ER"] * 10, "lively", seed=1)
    _, second = label(["B", "EH", "T", "ER"] * 10, "lively", seed=2)
    differing = {name for name, k in UNIT.items() if (first[:, k] != second[:, k]).any()}
    assert any(name.startswith("eye") for name in differing)
    assert not [name for name in differing if name.startswith(("mouth", "jaw", "tongue"))]


@pytest.mark.parametrize("style", [style.name for style in STYLES])
@pytest.mark.parametrize("stop", ["P", "B", "M"])
@pytest.mark.parametrize("length_s", [0.04, 0.07, 0.12])
def test_lips_close_between_open_vowels(head, style, stop, length_s):
    phones, weights = label(["AA", stop, "AE", stop, "AO"], style, length_s=length_s)
    counted = count_lip_sync(phones, head.opening(weights), rest_of(head), FPS)
    assert (counted.closed, counted.n_closures) == (2, 2)


@pytest.mark.parametrize("style", [style.name for style in STYLES])
def test_open_vowels_open_and_silence_rests(head, style):
    phones, weights = label(["M", "AA", "P", "AE", "B", "AY", "M"], style, length_s=0.12)
    counted = count_lip_sync(phones, head.opening(weights), rest_of(head), FPS)
    assert (counted.opened, counted.n_openings) == (3, 3)
    assert (counted.rested, counted.n_rests) == (2, 2)


@pytest.mark.parametrize("sound_name", ["F", "V"])
def test_the_lower_lip_is_under_the_upper_teeth(sound_name):
    phones, weights = label(["AA", sound_name, "AA"], length_s=0.12)
    biting = during(weights[:, UNIT["mouthRollLower"]], phones[2]).max()
    assert biting > 0.35
    frame = int((phones[2].start_s + phones[2].end_s) / 2 * FPS)
    assert weights[frame, UNIT["jawOpen"]] < 0.1 < weights[:, UNIT["jawOpen"]].max()


def test_rounding_comes_before_the_rounded_vowel():
    phones, weights = label(["T", "T", "UW", "T"], length_s=0.1)
    pucker = weights[:, UNIT["mouthPucker"]].astype(float)
    before = during(pucker, phones[2])
    assert before[-1] > 0.2
    assert pucker.argmax() / FPS == pytest.approx(3 * 0.1 + 0.45, abs=0.1)


def test_styles_are_ordered_by_how_wide_they_open(head):
    widest = {}
    for style in ("mumbling", "calm", "lively"):
        _, weights = label(["HH", "AA", "T", "AE", "T"], style, length_s=0.14)
        widest[style] = head.opening(weights).max()
    assert widest["mumbling"] + 2e-3 < widest["calm"] < widest["lively"] - 2e-3


def test_loud_vowels_open_wider_than_soft_ones(head):
    phones = said(["AA", "T", "AA", "T", "AA"], length_s=0.2)
    middle, loud = phones[3], sound(phones)
    soft = loud.copy()
    soft[round(middle.start_s * SAMPLE_RATE) : round(middle.end_s * SAMPLE_RATE)] *= 0.2
    wide, narrow = (
        during(head.opening(face_weights(audio, phones, style_named("calm"), 0)), middle).max()
        for audio in (loud, soft)
    )
    assert narrow + 5e-4 < wide


def test_eyes_blink_fully_and_weights_are_weights():
    _, weights = label(["AH", "T"] * 100, "weary", seed=0)
    assert weights.dtype == np.float16
    assert (weights.min(), weights.max()) >= (0, 0)
    assert weights.max() <= 1
    blinks = weights[:, UNIT["eyeBlinkLeft"]].astype(float)
    assert blinks.max() > 0.6
    assert (blinks > 0.5).mean() < 0.2


def test_eyes_blink_when_speech_pauses():
    for seed in range(20):
        phones, weights = label(["AH", "T"] * 10, seed=seed)
        assert during(weights[:, UNIT["eyeBlinkLeft"]], phones[-1]).max() > 0.9


def test_length_is_that_of_the_audio():
    assert frames_in(SAMPLE_RATE) == 30
    assert frames_in(SAMPLE_RATE - 1) == 29
    phones, weights = label(["AA"])
    assert len(weights) == frames_in(len(sound(phones)))


def test_silence_alone_can_be_labelled(head):
    phones = [Phone(SILENCE, 0.0, 1.0)]
    weights = face_weights(np.zeros(SAMPLE_RATE, np.float32), phones, style_named("calm"), 0)
    assert np.isfinite(weights).all()
    assert np.abs(head.opening(weights) - rest_of(head)).max() < 0.5e-3


def test_gaps_between_phones_are_refused():
    phones = [Phone(SILENCE, 0.0, 0.4), Phone("AA", 0.5, 1.0)]
    with pytest.raises(AlignmentError, match="do not meet"):
        face_weights(np.zeros(SAMPLE_RATE, np.float32), phones, style_named("calm"), 0)
