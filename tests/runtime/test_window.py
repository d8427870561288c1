"""`window` mode: equal to `exact` while it can be, the same work for any length afterwards."""

import numpy as np
import pytest

from facecode.past import ThinnedPast
from facecode.request import Request
from facecode.window import DELAY, PAST_SLOTS, WindowMotion


def encoded(face, speech, n_frames, start=0):
    n = int(n_frames * 16000 / 30) + 300
    return face.encode(np.resize(speech[0], start + n)[start:])


def moved(face, memory, window=None, style=0):
    weights = np.eye(len(face.styles), dtype=np.float32)[style : style + 1]
    ((codes, offsets),) = face.move([memory], weights, Request(window))
    return codes[0], offsets[0]


@pytest.mark.parametrize("n_frames", [1, 2, 3, 4, 5, 9, 33, 47])
def test_as_exact_for_clips_of_up_to_window_frames(tiny, speech, n_frames):
    memory = encoded(tiny, speech, n_frames)
    exact, window = moved(tiny, memory), moved(tiny, memory, max(3, memory.n_frames))
    np.testing.assert_array_equal(window[0], exact[0])
    np.testing.assert_allclose(window[1], exact[1], atol=1e-5)


def test_clips_side_by_side_are_as_alone(tiny, speech):
    memories = [encoded(tiny, speech, n, 1000 * n) for n in (90, 60, 59, 2)]
    weights = np.eye(3, dtype=np.float32)[[0, 1, 2, 0]]
    together = tiny.move(memories, weights, Request(5))
    for i, memory in enumerate(memories):
        codes, offsets = moved(tiny, memory, 5, style=i % 3)
        np.testing.assert_array_equal(together[i][0][0], codes)
        np.testing.assert_allclose(together[i][1][0], offsets, atol=1e-5)


def test_blocks_are_the_clip(tiny, speech):
    memory = encoded(tiny, speech, 150)
    codes, offsets = moved(tiny, memory, 5)
    blocks = list(tiny.blocks(memory, np.eye(3, dtype=np.float32)[0], 5))
    assert len(blocks) > 1
    np.testing.assert_array_equal(np.concatenate([c for c, _ in blocks]), codes)
    np.testing.assert_allclose(np.concatenate([o for _, o in blocks]), offsets, atol=1e-5)


def test_state_does_not_grow(tiny):
    part = tiny.parts[0]
    shape = (part.codes_per_frame, part.codebook.rows.shape[1])
    shown = []
    motion = WindowMotion(part.motion, 1, shape, 5, lambda rows, hidden: shown.append(hidden))
    rng = np.random.default_rng(0)
    sizes = []
    for frame in range(3 * PAST_SLOTS):
        if frame:
            motion.feed_back(1)
        codes = rng.integers(0, len(part.codebook.rows), (1, part.codes_per_frame))
        motion.append(part.codebook.look_up(codes))
        arrays = [a for v in vars(motion).values() for a in (v if isinstance(v, list) else [v])]
        sizes.append(sum(a.nbytes for a in arrays if isinstance(a, np.ndarray)))
    assert sizes[10] == sizes[-1]
    motion.finish()
    assert sum(h.shape[1] for h in shown) == 3 * PAST_SLOTS
    assert shown[-1].shape[1] == DELAY + 1


def test_norm_over_the_whole_past(tiny):
    """The state holds mean and variance of all convolution outputs that are final."""
    part = tiny.parts[0]
    shape = (part.codes_per_frame, part.codebook.rows.shape[1])
    motion = WindowMotion(part.motion, 1, shape, 5, lambda rows, hidden: None)
    rng = np.random.default_rng(1)
    codes = rng.integers(0, len(part.codebook.rows), (1, 40, part.codes_per_frame))
    vectors = part.codebook.look_up(codes)
    for t in range(40):
        motion.append(vectors[:, t])
        motion.feed_back(1)
    (activations,) = part.motion.run(("activations",), vectors, np.array([0]))
    final = activations[0, :38]
    np.testing.assert_allclose(motion._mean[0], final.mean(0), atol=1e-5)
    np.testing.assert_allclose(motion._squares[0] / 38, final.var(0), atol=1e-5)


def test_thinned_past_is_even_and_stands_for_all():
    past = ThinnedPast(8)
    for frame in range(1000):
        past.slot_for(frame)
        kept = np.sort(past._frames[past._frames >= 0])
        np.testing.assert_array_equal(kept, np.arange(0, frame + 1, past.stride))
        weight = np.exp(past.log_weights()).sum()
        assert frame + 1 <= weight < frame + 1 + past.stride
    assert past.stride == 128


def test_slots_take_turns():
    past = ThinnedPast(8)
    for frame in range(5):
        past.slot_for(frame)
    turns = []
    for _ in range(5):
        slots = past.oldest_first(2)
        past.advance(slots)
        turns += slots.tolist()
    assert turns == [0, 1, 2, 3, 4, 0, 1, 2, 3, 4]
    assert past.oldest_first(99).tolist() == [0, 1, 2, 3, 4]
