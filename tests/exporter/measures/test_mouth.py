"""The measures of a mouth, on mouths whose answer is known."""

import dataclasses

import numpy as np
import pytest

from facecode_exporter.measures.mouth import (
    Mouth,
    Speaker,
    agreement,
    confidence,
    curve_around,
    describe,
    moments,
    rounded_dip,
)
from facecode_exporter.measures.phone import Phone

FPS = 25.0
TIMES = moments(100, FPS)


def bump(centre, width=0.08):
    return np.exp(-np.square((TIMES - centre) / width))


def mouth(gap, *phones, width=None, loudness=None):
    return Mouth(
        np.asarray(gap, float),
        np.full(len(gap), 50.0) if width is None else width,
        np.asarray(gap if loudness is None else loudness, float),
        [Phone(*p) for p in phones],
        FPS,
    )


def open_but_at(*centres):
    return 10 - sum(10 * bump(c) for c in centres)


def test_closures_and_when_they_close():
    phones = [("B", 0.95, 1.05), ("P", 2.95, 3.05)]
    good = describe(Speaker.of([mouth(open_but_at(1.0, 3.0), *phones)]))
    assert good["P B M below 0.15, %"] == 100
    assert good["moment of least gap in P B M, ms"] == pytest.approx(50, abs=25)
    late = describe(Speaker.of([mouth(open_but_at(1.04, 3.04), *phones)]))
    assert late["moment of least gap in P B M, ms"] == pytest.approx(90, abs=25)
    never = describe(Speaker.of([mouth(open_but_at(2.0), *phones)]))
    assert never["P B M below 0.15, %"] == 0


def test_a_dip_and_a_peak_of_rounded_sounds():
    phones = [("W", 1.0, 1.1), ("UW", 3.0, 3.1)]
    at, around = rounded_dip(Speaker.of([mouth(open_but_at(1.0, 3.0), *phones)]))
    assert at < 1.5 < around
    at, around = rounded_dip(Speaker.of([mouth(10 - open_but_at(1.0, 3.0), *phones)]))
    assert at > around


def test_speeds_tell_closing_from_opening():
    saw = np.tile(np.r_[np.linspace(0, 10, 16, endpoint=False), np.linspace(10, 0, 4)], 5)
    found = describe(Speaker.of([mouth(saw)]))
    assert found["closing speed p95, 1/s"] > 3 * found["opening speed p95, 1/s"]
    other = describe(Speaker.of([mouth(saw[::-1])]))
    assert other["opening speed p95, 1/s"] == pytest.approx(found["closing speed p95, 1/s"])


def test_the_range_is_the_speakers_own():
    one = mouth(open_but_at(1.0, 3.0), ("AA", 1.9, 2.1))
    twice = dataclasses.replace(one, gap_mm=2 * one.gap_mm + 1)
    first, second = describe(Speaker.of([one])), describe(Speaker.of([twice]))
    for name in ("greatest gap in AA AE AH AW AY AO", "speed p95, 1/s"):
        assert first[name] == pytest.approx(second[name])
    assert second["gap at rest, mm"] == pytest.approx(2 * first["gap at rest, mm"] + 1)


def test_widths_are_shares_of_the_speakers_median():
    width = 50 - 5 * bump(1.0, 0.3)
    found = describe(Speaker.of([mouth(open_but_at(1.0), ("UW", 0.95, 1.05), width=width)]))
    assert found["width in UW OW"] == pytest.approx(0.9, abs=0.02)


def test_lips_behind_the_loudness():
    gap = sum(10 * bump(c, 0.15) for c in (0.8, 1.7, 2.9))
    loudness = np.interp(TIMES + 0.06, TIMES, gap)
    found = describe(Speaker.of([mouth(gap, loudness=loudness)]))
    assert found["lips behind loudness, ms"] == pytest.approx(60, abs=10)
    assert found["r with loudness"] > 0.98


def test_silences():
    phones = [("SIL", 0.0, 0.6), ("SIL", 3.0, 3.2)]
    parted = describe(Speaker.of([mouth(open_but_at(2.0), *phones)]))
    resting = describe(Speaker.of([mouth(np.where(TIMES < 0.6, 0, open_but_at(2.0)), *phones)]))
    assert parted["silences parted, %"] == 100
    assert resting["silences parted, %"] == 0


def test_agreement_is_highest_at_the_shift():
    curve = np.random.default_rng(0).standard_normal(60).cumsum()
    assert agreement(curve, curve) == (pytest.approx(1), pytest.approx(1))
    still, shifted = agreement(np.roll(curve, 3), curve)
    assert still < 0.99
    assert shifted > 0.99
    assert np.isnan(agreement(np.zeros(60), curve)[0])


def test_curves_around_sounds():
    speaker = Speaker.of([mouth(open_but_at(1.0, 3.0), ("M", 1.0, 1.1), ("M", 3.0, 3.1))])
    times, gap = curve_around(speaker, ("M",))
    assert abs(times[np.argmin(gap)]) <= 0.03
    assert np.isnan(curve_around(speaker, ("F",))[1]).all()


def test_confidence_is_the_same_every_time():
    values = list(np.random.default_rng(1).normal(0.7, 0.1, 60))
    low, high = confidence(values)
    assert (low, high) == confidence(values)
    assert low < np.median(values) < high
    assert high - low < 0.1
    assert all(np.isnan(confidence([float("nan")])))


def test_nothing_to_judge_is_no_number():
    found = describe(Speaker.of([mouth(open_but_at(1.0))]))
    assert np.isnan(found["least gap in F V"])
