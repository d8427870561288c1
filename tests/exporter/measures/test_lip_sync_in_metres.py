"""Counting closures, openings and rests on curves made by hand."""

import numpy as np

from facecode_exporter.measures.lip_sync import LipSync, count_lip_sync
from facecode_exporter.measures.phone import Phone

PHONES = [Phone("SIL", 0, 1), Phone("M", 1, 1.2), Phone("AA", 1.2, 1.6), Phone("SIL", 1.6, 2.6)]


def curve(**values):
    """(78,) a mouth 1 mm open but for the given frames, in millimetres."""
    opening = np.ones(78, np.float32)
    for frames, value in values.items():
        first, last = map(int, frames.strip("f").split("_"))
        opening[first:last] = value
    return opening * 1e-3


def test_a_mouth_that_does_what_it_should():
    assert count_lip_sync(PHONES, curve(f38_46=8), 1e-3, 30) == LipSync(1, 1, 1, 1, 2, 2)


def test_a_mouth_that_never_moves_does_not_open():
    assert count_lip_sync(PHONES, curve(), 1e-3, 30) == LipSync(1, 1, 1, 0, 2, 2)


def test_a_mouth_that_hangs_open_neither_closes_nor_rests():
    assert count_lip_sync(PHONES, curve(f0_78=8), 1e-3, 30) == LipSync(1, 0, 1, 1, 2, 0)


def test_phones_beyond_the_motion_are_not_counted():
    assert count_lip_sync(PHONES, curve()[:10], 1e-3, 30) == LipSync(0, 0, 0, 0, 1, 1)


def test_counts_add_up_and_read_well():
    total = LipSync(1, 1, 1, 0, 2, 2) + LipSync(1, 0, 1, 1, 2, 2)
    assert str(total) == (
        "P B M closed 50.0 % of 2, open vowels open 50.0 % of 2, at rest in silence 100.0 % of 4"
    )
    assert str(LipSync()).startswith("P B M closed - of 0")
