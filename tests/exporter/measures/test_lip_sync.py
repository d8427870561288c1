"""Verdicts on curves that can be drawn by hand: 10 fps, so that frame t is at t / 10 s."""

from typing import NamedTuple

import numpy as np
import pytest

from facecode_exporter.measures.lip_sync import (
    Share,
    chance,
    closures,
    frames,
    opening_curve,
    openings,
    relative_opening,
    rests,
)

FPS = 10.0


class Phone(NamedTuple):
    name: str
    start_s: float
    end_s: float


def curve(*values):
    return np.array(values, np.float32)


def met(verdicts):
    return [v.met for v in verdicts]


def test_opening_is_the_distance_of_the_pair_beyond_rest():
    template = np.array([[0, 1, 0], [0, 0, 0], [9, 9, 9]], np.float32)  # rest gap 1
    vertices = np.stack([template] * 3)
    vertices[1, 0] = (0, 3, 4)  # distance 5
    vertices[2, 0] = (0, 0.5, 0)  # pressed
    np.testing.assert_allclose(opening_curve(vertices, (0, 1), template), [0, 4, -0.5])


def test_the_full_opening_is_the_95th_percentile():
    opening = np.arange(21, dtype=np.float32)  # 0..20: its 95th percentile is 19
    np.testing.assert_allclose(relative_opening(opening), opening / 19)


@pytest.mark.parametrize("opening", [[0, 0, 0], [-1, -1, -0.5], [0.1, 0.1, 0.1], []])
def test_a_mouth_that_does_not_move_is_zero_throughout(opening):
    np.testing.assert_array_equal(
        relative_opening(curve(*opening), frozen=0.2), 0 * curve(*opening)
    )


@pytest.mark.parametrize(
    ("start_s", "end_s", "around", "expected"),
    [
        (0.1, 0.3, 0, [1, 2, 3]),  # both ends included, although 0.3 * 10 is not exactly 3
        (0.11, 0.29, 0, [2]),
        (0.11, 0.19, 0, []),  # between two frames
        (0.11, 0.19, 1, [1, 2]),
        (0.0, 0.1, 1, [0, 1, 2]),  # nothing before the first frame
        (0.38, 0.6, 1, [3, 4]),  # nothing after the last
        (0.7, 0.9, 1, []),
        (-0.5, -0.2, 1, []),
    ],
)
def test_frames_of_a_phone(start_s, end_s, around, expected):
    assert list(range(5))[frames(start_s, end_s, FPS, 5, around)] == expected


def test_closures_look_one_frame_beyond_the_phone():
    phones = [Phone("B", 0.3, 0.4)]  # frames 3 and 4; 2 and 5 count too
    for t in range(8):
        relative = np.ones(8, np.float32)
        relative[t] = 0.1
        assert met(closures(phones, relative, FPS)) == [t in (2, 3, 4, 5)]


def test_closed_is_below_fifteen_percent_and_not_at_it():
    phones = [Phone("P", 0.1, 0.2)]
    assert met(closures(phones, curve(1, 0.25, 0.25, 1), FPS)) == [False]
    assert met(closures(phones, curve(1, 0.15000001, 1, 1), FPS)) == [False]
    assert met(closures(phones, curve(1, 0.1499, 1, 1), FPS)) == [True]


def test_which_phones_are_judged():
    short, long = [Phone("M", 0.1, 0.13)], [Phone("M", 0.1, 0.14)]  # 0.04 is not exact in binary
    relative = np.zeros(9, np.float32)
    assert len(closures(short, relative, FPS)) == 0
    assert len(closures(long, relative, FPS)) == 1
    assert closures([Phone("N", 0.1, 0.3), Phone("SIL", 0.1, 0.3)], relative, FPS) == []
    assert closures([Phone("M", 5.0, 5.2)], relative, FPS) == []  # after the clip
    assert len(openings([Phone("AA", 0.1, 0.15)], relative, FPS)) == 0
    assert len(openings([Phone("AA", 0.1, 0.16)], relative, FPS)) == 1
    assert len(rests([Phone("SIL", 0.1, 0.39)], relative, FPS)) == 0
    assert len(rests([Phone("SIL", 0.1, 0.4)], relative, FPS)) == 1


def test_openings_look_at_the_phone_alone():
    phones = [Phone("AY", 0.3, 0.4)]
    for t in range(8):
        relative = np.full(8, 0.35, np.float32)
        relative[t] = 0.4
        assert met(openings(phones, relative, FPS)) == [t in (3, 4)]


def test_rests_must_hold_between_the_settling_times():
    phones = [Phone("SIL", 0.1, 0.8)]  # settled from 0.25 to 0.65: frames 3, 4, 5, 6
    for t in range(10):
        relative = np.zeros(10, np.float32)
        relative[t] = 0.2
        verdict = rests(phones, relative, FPS)[0]
        assert verdict.met == (t not in (3, 4, 5, 6))
        assert verdict.opening == pytest.approx(0.0 if verdict.met else 0.2)


def test_a_short_rest_is_judged_in_the_first_frame_after_settling():
    relative = curve(1, 1, 1, 0, 1)
    assert met(rests([Phone("SIL", 0.1, 0.4)], relative, FPS)) == [True]  # 0.25 to 0.25: frame 3
    assert rests([Phone("SIL", 0.3, 0.6)], relative, FPS) == []  # that frame is after the clip


def test_shares_add_up_and_nothing_to_judge_is_no_share():
    relative = curve(1, 0, 1, 1, 1)
    verdicts = closures([Phone("P", 0.1, 0.2), Phone("B", 0.4, 0.5)], relative, FPS)
    assert Share.of(verdicts) == Share(2, 1)
    assert (Share(2, 1) + Share(1, 1)).share == pytest.approx(2 / 3)
    assert Share().share is None


def test_a_frozen_mouth_closes_by_chance_and_never_opens():
    phones = [Phone("M", 0.2, 0.3), Phone("AA", 0.4, 0.6)]
    frozen = np.zeros(20, np.float32)
    assert chance(closures, phones, frozen, FPS) == 1
    assert chance(openings, phones, frozen, FPS) == 0
    assert chance(rests, phones, frozen, FPS) is None


def test_chance_is_the_mean_over_shifts_of_the_curve():
    # 20 frames, shifted by 5, 10 and 15: the one closed frame, 3, comes to 8, 13 and 18.
    relative = np.ones(20, np.float32)
    relative[3] = 0
    assert chance(closures, [Phone("M", 0.3, 0.4)], relative, FPS) == 0
    assert chance(closures, [Phone("M", 0.8, 0.9)], relative, FPS) == pytest.approx(1 / 3)
