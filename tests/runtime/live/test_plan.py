"""Lengths of a stream's windows."""

import dataclasses

import pytest
from conftest import TINY

from facecode.bundle import read_manifest
from facecode.live.plan import Plan
from facecode_spec.live import LiveEntry
from facecode_spec.plain import SpecError

MANIFEST = read_manifest(TINY)


@pytest.mark.parametrize("fps", [25.0, 30.0, 50.0, 60.0])
@pytest.mark.parametrize("look_ahead_ms", [100, 133, 200, 270, 400, 1000])
def test_windows_end_between_two_rows_of_the_encoder(fps, look_ahead_ms):
    plan = Plan.of(dataclasses.replace(MANIFEST, fps=fps), look_ahead_ms)
    seconds = (plan.context + plan.block + plan.look_ahead) / fps
    assert seconds * 50 == pytest.approx(round(seconds * 50), abs=1e-9)
    assert fps <= plan.context < 1.2 * fps
    assert plan.look_ahead == round(look_ahead_ms / 1000 * fps)


def test_a_rate_that_has_no_such_windows_is_left_as_it_is():
    assert Plan.of(dataclasses.replace(MANIFEST, fps=29.97)).context == 30


@pytest.mark.parametrize(
    "wrong",
    [
        {"context_s": 31.0},
        {"context_s": float("nan")},
        {"block_s": 0.0},
        {"look_ahead_ms": 0.0},
        {"delay_frames": -1},
    ],
)
def test_a_plan_that_is_none(wrong):
    with pytest.raises(SpecError, match="live"):
        LiveEntry(
            **{"context_s": 1.0, "block_s": 0.1, "delay_frames": 1}
            | wrong
            | {"look_ahead_ms": wrong.get("look_ahead_ms", 200.0)}
        )


def test_a_delay_beyond_the_reach_of_the_convolution():
    live = LiveEntry(context_s=1.0, block_s=0.1, delay_frames=9, look_ahead_ms=200.0)
    with pytest.raises(SpecError, match="delay_frames"):
        dataclasses.replace(MANIFEST, live=live)
