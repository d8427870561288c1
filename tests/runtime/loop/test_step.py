"""Past keys and values in their slots, and the end of the loop."""

import numpy as np
import pytest

from facecode.loop.step import KeyValueCache


def frame(t: int, n_batch: int) -> np.ndarray:
    """Rows (2 layers, batch, 4) that tell frame, clip and channel apart."""
    clip = t + np.arange(n_batch)[:, None] / 8 + np.arange(4) / 64
    return np.stack([clip, 1000 + clip]).astype(np.float32)


@pytest.mark.parametrize("n_batch", [1, 3])
@pytest.mark.parametrize("limit", [None, 100])
def test_keys_stand_in_their_slots_head_by_head_and_are_not_copied(n_batch, limit):
    cache = KeyValueCache(n_layers=2, n_batch=n_batch, dim=4, n_heads=2, limit=limit)
    assert list(cache.inputs()) == ["past_keys_0", "past_keys_1", "past_values_0", "past_values_1"]
    for t in range(250):
        n = n_batch if t < 120 else 1
        cache.append(frame(t, n), frame(t, n) - 0.5)
        inputs = cache.inputs(n)
        assert all(rows.flags.c_contiguous and rows.base is not None for rows in inputs.values())
        keys, values = inputs["past_keys_1"], inputs["past_values_1"]
        oldest = 0 if limit is None else max(0, t + 1 - limit)
        assert t + 1 - oldest <= keys.shape[2] <= (limit or 1.125 * (t + 33))
        kept = np.arange(oldest, t + 1)
        rows = np.stack([frame(past, n)[1].reshape(n, 2, 2) for past in kept], axis=2)
        np.testing.assert_array_equal(keys[:, :, kept % keys.shape[2]], rows)
        np.testing.assert_array_equal(values[:, :, kept % keys.shape[2]], rows - 0.5)


def test_the_last_frame_of_the_loop_has_no_codes_and_makes_the_rest_final(tiny, speech):
    engine = tiny.engine
    memory = engine.encode(speech[0][:16000])
    request = engine.request(window=tiny.window("window", 5))
    frames = list(engine.frames([memory], request))
    assert len(frames) == memory.n_frames + 1
    assert [bool(frame.codes) for frame in frames] == [True] * memory.n_frames + [False]
    n_final = sum(hidden.shape[1] for frame in frames for _, hidden in frame.final[0])
    assert n_final == memory.n_frames
    exact = list(engine.frames([memory], engine.request()))
    assert not any(final for frame in exact for final in frame.final)
