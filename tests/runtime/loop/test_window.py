"""`window` mode: equal to `exact` while it can be, the same work for any length afterwards."""

import numpy as np
import pytest

from facecode.loop.engine import Faces, blocks
from facecode.loop.window import PAST_SLOTS, WindowMotion

DELAY = 30


def encoded(face, speech, n_frames, start=0):
    n = int(n_frames * 16000 / 30) + 300
    return face.engine.encode(np.resize(speech[0], start + n)[start:])


def moved(face, memory, window=None, style=0):
    weights = np.eye(len(face.styles), dtype=np.float32)[style]
    how = None if window is None else face.window("window", window)
    ((codes, offsets),) = face.engine.move([memory], face.engine.request(weights, how))
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
    request = tiny.engine.request(weights, tiny.window("window", 5))
    together = tiny.engine.move(memories, request)
    for i, memory in enumerate(memories):
        codes, offsets = moved(tiny, memory, 5, style=i % 3)
        np.testing.assert_array_equal(together[i][0][0], codes)
        np.testing.assert_allclose(together[i][1][0], offsets, atol=1e-5)


def test_blocks_are_the_clip(tiny, speech):
    memory = encoded(tiny, speech, 150)
    codes, offsets = moved(tiny, memory, 5)
    engine = tiny.engine
    frames = engine.frames([memory], engine.request(window=tiny.window("window", 5)))
    given = list(blocks(Faces(engine.parts, engine.n_vertices, 1), frames))
    assert [c.shape[1] for c, _ in given] == [64, 64, len(codes) - 128]
    np.testing.assert_array_equal(np.concatenate([c[0] for c, _ in given]), codes)
    np.testing.assert_array_equal(np.concatenate([o[0] for _, o in given]), offsets)


def test_state_does_not_grow(tiny):
    part = tiny.engine.parts[0]
    shape = (part.codes_per_frame, part.codebook.rows.shape[1])
    final = []
    motion = WindowMotion(part.motion, 1, shape, 5, DELAY)
    rng = np.random.default_rng(0)
    sizes = []
    for frame in range(3 * PAST_SLOTS):
        if frame:
            motion.feed_back(1)
        final += motion.take_final()
        codes = rng.integers(0, len(part.codebook.rows), (1, part.codes_per_frame))
        motion.append(part.codebook.look_up(codes))
        arrays = [a for v in vars(motion).values() for a in (v if isinstance(v, list) else [v])]
        sizes.append(sum(a.nbytes for a in arrays if isinstance(a, np.ndarray)))
    assert sizes[10] == sizes[-1]
    motion.finish()
    final += motion.take_final()
    assert sum(hidden.shape[1] for _, hidden in final) == 3 * PAST_SLOTS
    assert final[-1][1].shape[1] == DELAY + 1


def test_norm_over_the_whole_past(tiny):
    """The state holds mean and variance of all convolution outputs that are final."""
    part = tiny.engine.parts[0]
    shape = (part.codes_per_frame, part.codebook.rows.shape[1])
    motion = WindowMotion(part.motion, 1, shape, 5, DELAY)
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
