"""A recording is as long as what was said, in time with it, and the same for the same numbers."""

import numpy as np
import pytest
from conftest import SPEECH

from facecode.audio import load_audio
from facecode_exporter.corpus.room_acoustics import empty_room, gated, recorded, with_breath


@pytest.fixture(scope="module")
def clean():
    return load_audio(SPEECH, 16_000)[:48_000]


@pytest.mark.parametrize("seed", range(8))
def test_recordings_keep_time(clean, seed):
    heard = recorded(clean, np.random.default_rng(seed))
    np.testing.assert_array_equal(heard, recorded(clean, np.random.default_rng(seed)))
    assert heard.dtype == np.float32
    assert heard.shape == clean.shape
    assert np.abs(heard).max() <= 1
    loud, before = (
        np.abs(x[: len(x) // 160 * 160]).reshape(-1, 160).max(1) for x in (heard, clean)
    )
    shifts = [np.corrcoef(np.roll(loud, k), before)[0, 1] for k in range(-5, 6)]
    assert abs(int(np.argmax(shifts)) - 5) <= 1  # 10 ms


def test_empty_rooms_differ():
    rooms = [empty_room(16_000, np.random.default_rng(seed)) for seed in range(20)]
    assert all(room.shape == (16_000,) and np.abs(room).max() <= 1 for room in rooms)
    levels = [float(np.sqrt(np.square(room).mean())) for room in rooms]
    assert min(levels) == 0
    assert max(levels) > 0.01


def test_some_pauses_have_a_breath_in_them():
    pauses = [with_breath(np.zeros(9600, np.float32), np.random.default_rng(k)) for k in range(60)]
    loud = [float(np.abs(pause).max()) for pause in pauses]
    assert all(pause.shape == (9600,) and pause.dtype == np.float32 for pause in pauses)
    assert 10 < sum(level > 0 for level in loud) < 40
    assert max(loud) < 0.5
    assert not with_breath(np.zeros(160, np.float32), np.random.default_rng(0)).any()


def test_a_gate_leaves_zeros_in_pauses_only():
    heard = np.full(16_000, 0.1, np.float32)
    cut = gated(heard, [(0.25, 0.5), (0.9, 1.0)])
    zeros = np.flatnonzero(cut == 0) / 16_000
    assert zeros.min() == pytest.approx(0.31)
    assert zeros.max() == pytest.approx(0.44, abs=1e-3)  # the second pause is all edge
    assert (heard > 0).all()
