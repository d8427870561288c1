"""Phone times of a recording; the recording is the demo's speech sample or made on the spot."""

import numpy as np
import pytest

from facecode_exporter.corpus.phones import (
    SAMPLE_RATE,
    Aligner,
    covering,
    merged,
    require_contiguous,
    sounding,
    words_of,
)
from facecode_exporter.errors import AlignmentError
from facecode_exporter.measures.phone import SILENCE, Phone


@pytest.fixture(scope="module")
def aligner():
    pytest.importorskip("pocketsphinx", reason="needs the extra corpus")
    return Aligner()


@pytest.fixture(scope="module")
def spoken():
    pytest.importorskip("hibari", reason="needs the extra corpus")
    from facecode_exporter.corpus.voices import VOICES, speak

    return speak("My baby may move a big map.", VOICES[0], seed=1)


def test_words_keep_apostrophes_and_lose_punctuation():
    assert words_of("It\u2019s five, Bob's FIVE!") == ["it's", "five", "bob's", "five"]


def test_silences_that_touch_become_one():
    rows = [Phone(SILENCE, 0, 1), Phone(SILENCE, 1, 2), Phone("B", 2, 2), Phone("AA", 2, 3)]
    assert merged(rows) == [Phone(SILENCE, 0, 2), Phone("AA", 2, 3)]


def test_phones_are_made_to_cover_the_recording():
    covered = covering([Phone("AA", 0.0, 0.5), Phone("T", 0.51, 0.6)], 0.2, 1.0)
    assert covered == [
        Phone(SILENCE, 0.0, 0.2),
        Phone("AA", 0.2, 0.71),
        Phone("T", 0.71, 0.8),
        Phone(SILENCE, 0.8, 1.0),
    ]
    assert covering([], 0.0, 1.0) == [Phone(SILENCE, 0.0, 1.0)]


def test_the_sounding_part_is_found():
    audio = np.zeros(2 * SAMPLE_RATE, np.float32)
    audio[16000:20000] = 0.3
    assert sounding(audio) == (16000 - 1120, 20000 + 800)
    for silent in (np.zeros(SAMPLE_RATE, np.float32), np.zeros(0, np.float32)):
        with pytest.raises(AlignmentError, match="silent"):
            sounding(silent)


def test_every_sound_gets_its_place(aligner, spoken):
    phones = aligner.align(spoken, "My baby may move a big map.")
    require_contiguous(phones)
    names = [phone.name for phone in phones if phone.name != SILENCE]
    assert names[:6] == ["M", "AY", "B", "EY", "B", "IY"]
    assert (phones[0].start_s, phones[-1].end_s) == (0.0, pytest.approx(len(spoken) / SAMPLE_RATE))


def test_silence_before_speech_moves_the_phones(aligner, spoken):
    later = np.concatenate([np.zeros(SAMPLE_RATE, np.float32), spoken])
    first, second = (aligner.align(a, "My baby may move a big map.") for a in (spoken, later))
    assert [p.name for p in first] == [p.name for p in second]
    moved = [b.end_s - a.end_s for a, b in zip(first, second, strict=True)]
    assert moved == pytest.approx([1.0] * len(moved), abs=0.011)


def test_what_was_aligned_before_does_not_matter(aligner, spoken):
    text = "My baby may move a big map."
    alone = aligner.align(spoken, text)
    aligner.align(0.1 * spoken[:30000], "My baby may move")
    with pytest.raises(AlignmentError):
        aligner.align(spoken[8000:11000], text)
    assert aligner.align(spoken, text) == alone


@pytest.mark.parametrize(
    ("text", "message"),
    [("", "no words"), ("Blorpf the baby.", "no pronunciation for blorpf")],
)
def test_text_that_cannot_be_placed_is_refused(aligner, spoken, text, message):
    with pytest.raises(AlignmentError, match=message):
        aligner.align(spoken, text)


def test_too_short_a_recording_is_refused(aligner, spoken):
    with pytest.raises(AlignmentError, match="does not fit a recording"):
        aligner.align(spoken[8000:11000], "My baby may move a big map.")
