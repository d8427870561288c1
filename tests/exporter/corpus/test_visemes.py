"""The fitted visemes: whole, possible, and ordered as people's lips are."""

import json

import numpy as np
import pytest

from facecode_exporter.corpus.visemes import (
    ALIKE,
    BY_HAND,
    DIPHTHONGS,
    TIMING,
    VISEMES,
    Timing,
    as_json,
    from_json,
)
from facecode_exporter.head.face_units import UNIT
from facecode_exporter.head.head import load_head
from facecode_exporter.measures.phone import SILENCE


def gap_mm(name):
    return 1000 * float(
        np.diff(load_head().opening(np.stack([np.zeros(52), VISEMES[name].shape])))[0]
    )


def test_every_sound_has_a_viseme():
    assert VISEMES.keys() == BY_HAND.keys()
    parts = {part for pair in DIPHTHONGS.values() for part, _ in pair}
    assert {*parts, *ALIKE.values()} <= VISEMES.keys()
    for viseme in VISEMES.values():
        assert viseme.shape.min() >= 0
        assert viseme.shape.max() <= 1
        assert min(viseme.dominance.values()) > 0
    assert not VISEMES[SILENCE].shape.any()


def test_rounding_nearly_shuts_the_lips_and_front_vowels_are_as_open_as_aa():
    assert gap_mm("W") < 1
    assert gap_mm("UW") < 4
    assert VISEMES["UW"].shape[UNIT["mouthPucker"]] > 0.2
    for vowel in ("IY", "IH", "EH", "AH"):
        assert gap_mm(vowel) > 10


def test_json_and_back():
    visemes, timing = from_json(json.loads(json.dumps(as_json(VISEMES, TIMING))))
    assert timing == TIMING
    for name, viseme in VISEMES.items():
        assert visemes[name].shape == pytest.approx(viseme.shape, abs=5e-4)
        assert visemes[name].dominance == pytest.approx(dict(viseme.dominance), abs=5e-4)


def test_timing_by_hand_has_all_articulators():
    assert Timing.by_hand().reach_s.keys() == TIMING.reach_s.keys()
