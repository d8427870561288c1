"""One utterance of the demo corpus: sentences, a voice, pauses, and where every sound lies.

A few have no speech at all, so that a model learns to keep its mouth shut.

Comes in: numbers that name the utterance. Goes out: its text, sound and phones. The same numbers
give the same utterance, whatever was made before it.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facecode.arrays import Audio
from facecode_exporter.corpus.phones import (
    SAMPLE_RATE,
    Aligner,
    merged,
    shifted,
    sounding,
    words_of,
)
from facecode_exporter.corpus.prompts import sentence
from facecode_exporter.corpus.room_acoustics import empty_room, gated, recorded, with_breath
from facecode_exporter.corpus.voices import Voice, speak
from facecode_exporter.errors import AlignmentError
from facecode_exporter.measures.phone import SILENCE, Phone

SPLITS = ("train", "val", "test")
PAUSE_S = (0.3, 1.0)
EDGE_S = (0.2, 0.7)
LONG_S = (0.7, 2.5)
SHARE_OF_LONG = 0.25  # of edges and pauses
SHARE_OF_TWO_SENTENCES = 0.4
SHARE_WITHOUT_SPEECH = 0.07
SHARE_GATED = 0.4
IDLE_S = (1.5, 12.0)
NOBODY = "nobody"
"""The voice of a recording without speech."""
ATTEMPTS = 20


@dataclass(frozen=True)
class Utterance:
    """What is heard, and when."""

    text: str
    voice: str
    audio: Audio
    """(n,) 16 kHz"""
    phones: list[Phone]


def split_of(number: int) -> str:
    """Of every ten utterances eight are for training, one for validation, one for the test."""
    return {8: "val", 9: "test"}.get(number % 10, "train")


def sentence_split(text: str) -> str:
    """The only split that a sentence may appear in."""
    return split_of(zlib.crc32(text.encode()))


def make_utterance(
    key: Sequence[int],
    split: str,
    aligner: Aligner,
    voices: Sequence[Voice],
    vocabulary: Sequence[str],
) -> Utterance:
    """The utterance named by `key`, for one of SPLITS.

    Raises:
        AlignmentError: no attempt gave sentences that can be aligned.
    """
    rng = np.random.default_rng(key)
    if rng.random() < SHARE_WITHOUT_SPEECH:
        return _nobody_speaks(rng)
    allowed = [voice for voice in voices if split == "test" or not voice.held_out]
    for _ in range(ATTEMPTS):
        voice = allowed[int(rng.integers(len(allowed)))]
        n_sentences = 1 + (rng.random() < SHARE_OF_TWO_SENTENCES)
        texts = [_sentence_for(split, rng, vocabulary) for _ in range(n_sentences)]
        try:
            return _spoken(texts, voice, rng, aligner)
        except AlignmentError as error:
            failure = error
    raise AlignmentError(f"utterance {list(key)}: {ATTEMPTS} attempts failed, the last: {failure}")


def _sentence_for(split: str, rng: np.random.Generator, vocabulary: Sequence[str]) -> str:
    while True:
        text = sentence(rng, vocabulary)
        if sentence_split(text) == split:
            return text


def _spoken(
    texts: Sequence[str], voice: Voice, rng: np.random.Generator, aligner: Aligner
) -> Utterance:
    pace = rng.uniform(0.88, 1.15)
    sounds: list[Audio] = [_pause(EDGE_S, rng)]
    phones = [Phone(SILENCE, 0.0, len(sounds[0]) / SAMPLE_RATE)]
    for index, text in enumerate(texts):
        whole = speak(text, voice, int(rng.integers(2**31)), pace)
        first, last = sounding(whole)
        sound = _faded(whole[first:last])
        begin_s = sum(map(len, sounds)) / SAMPLE_RATE
        phones += shifted(aligner.align(sound, text), begin_s)
        gap = _pause(PAUSE_S if index + 1 < len(texts) else EDGE_S, rng)
        after_s = begin_s + len(sound) / SAMPLE_RATE
        phones.append(Phone(SILENCE, after_s, after_s + len(gap) / SAMPLE_RATE))
        sounds += [sound, gap]
    audio = recorded(np.concatenate(sounds), rng)
    if rng.random() < SHARE_GATED:
        audio = gated(audio, [(p.start_s, p.end_s) for p in phones if p.name == SILENCE])
    return Utterance(" ".join(texts), voice.name, audio, merged(phones))


def _nobody_speaks(rng: np.random.Generator) -> Utterance:
    """A few seconds of an empty room, or of nothing at all: the mouth is at rest."""
    audio = empty_room(round(rng.uniform(*IDLE_S) * SAMPLE_RATE), rng)
    return Utterance("", NOBODY, audio, [Phone(SILENCE, 0.0, len(audio) / SAMPLE_RATE)])


def _pause(usual_s: tuple[float, float], rng: np.random.Generator) -> Audio:
    """Zeros, some of them with a breath: nobody speaks, whatever is heard."""
    seconds = rng.uniform(*(LONG_S if rng.random() < SHARE_OF_LONG else usual_s))
    return with_breath(np.zeros(round(seconds * SAMPLE_RATE), np.float32), rng)


def _faded(sound: Audio) -> Audio:
    """No click where the sound meets the silence around it."""
    ramp = np.linspace(0, 1, SAMPLE_RATE // 200, dtype=np.float32)
    faded = sound.copy()
    faded[: len(ramp)] *= ramp
    faded[-len(ramp) :] *= ramp[::-1]
    return np.asarray(faded)


def vocabulary_of(aligner: Aligner, candidates: Sequence[str]) -> list[str]:
    """Words for word lists: those with a pronunciation, in a fixed order."""
    return sorted({w for w in candidates if words_of(w) == [w] and aligner.knows(w)})
