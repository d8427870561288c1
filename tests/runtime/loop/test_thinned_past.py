"""An even sample of an unbounded past, visited in turns."""

import numpy as np

from facecode.loop.thinned_past import ThinnedPast


def test_thinned_past_is_even_and_stands_for_all():
    past = ThinnedPast(8)
    for frame in range(1000):
        past.claim_slot(frame)
        kept = np.sort(past._frames[past._frames >= 0])
        np.testing.assert_array_equal(kept, np.arange(0, frame + 1, past.stride))
        weight = np.exp(past.log_weights()).sum()
        assert frame + 1 <= weight < frame + 1 + past.stride
    assert past.stride == 128


def test_slots_take_turns():
    past = ThinnedPast(8)
    for frame in range(5):
        past.claim_slot(frame)
    turns = []
    for _ in range(5):
        slots = past.oldest_first(2)
        past.advance(slots)
        turns += slots.tolist()
    assert turns == [0, 1, 2, 3, 4, 0, 1, 2, 3, 4]
    assert past.oldest_first(99).tolist() == [0, 1, 2, 3, 4]
