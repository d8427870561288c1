"""What a decoder hears in training is what it hears live, to the bit."""

import dataclasses

import numpy as np
import pytest
import torch

import facecode
from facecode.audio import SPEECH, load_audio
from facecode.live.memory import LiveMemory
from facecode.live.plan import Plan
from facecode_exporter.training.streamed_rows import random_plan, streamed_rows, whole_seconds


@pytest.fixture(scope="module")
def encoder():
    return facecode.load(threads=1).engine.speech_encoder


def one_of(rows):
    """The first tensor that a decoder reads, frame by frame."""
    return next(iter(rows.values()))


def test_rows_are_those_of_a_stream(encoder):
    wave = load_audio(SPEECH, 16_000)
    before, spoken = wave[: 3 * 16_000], wave[3 * 16_000 : 3 * 16_000 + 37_123]
    for plan in (
        Plan(30.0, 16_000, look_ahead=6, block=3, context=30),
        Plan(30.0, 16_000, look_ahead=3, block=6, context=60),
    ):
        memory = LiveMemory(encoder, plan, before)
        n_primer = memory.n_frames
        for _ in memory.hear(spoken):
            pass
        memory.end()
        live = [one_of(memory.frame(step)) for step in range(n_primer, memory.n_frames)]
        found = streamed_rows(
            lambda pieces: [
                torch.from_numpy(one_of(encoder.memory(piece, None).rows)[0]) for piece in pieces
            ],
            spoken,
            before,
            plan,
            rows_per_frame=1,
            normalise=False,
        )
        assert np.array_equal(found.numpy(), np.concatenate(live))


def test_plans_are_drawn_from_the_number_of_the_clip():
    plans = [random_plan(30.0, 16_000, seed) for seed in range(40)]
    assert plans == [random_plan(30.0, 16_000, seed) for seed in range(40)]
    assert {plan.look_ahead for plan in plans} == {3, 6, 9, 12}
    assert {plan.context for plan in plans} == {30, 60}
    assert all(dataclasses.replace(p, fps=25.0).fps == 25 for p in plans)


def test_what_was_spoken_before_lasts_whole_seconds():
    assert len(whole_seconds(np.ones(16_000 * 9 + 5, np.float32), 16_000)) == 48_000
    assert len(whole_seconds(np.ones(20_000, np.float32), 16_000)) == 16_000
    assert len(whole_seconds(np.ones(500, np.float32), 16_000)) == 16_000
