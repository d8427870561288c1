"""A part without a codebook: one mode, motion frame by frame, and clear words about codes."""

import numpy as np
import pytest
from conftest import SPEECH, TINY_FACEFORMER

import facecode
from facecode.audio import load_audio
from facecode.errors import ManifestError, ModeError, NoCodesError, SampleError
from facecode.loop.step import Frame
from facecode.loop.window import LONGEST_PAST

LENGTHS_S = (1.3, 0.2, 2.04, 0.77, 0.2)


@pytest.fixture(scope="module")
def recordings():
    speech = load_audio(SPEECH, 16_000)
    ends = np.cumsum(LENGTHS_S)
    pairs = zip(ends, LENGTHS_S, strict=True)
    return [speech[int(16_000 * (end - n)) : int(16_000 * end)] for end, n in pairs]


def test_a_clip_has_motion_and_no_codes(tiny_faceformer, tmp_path):
    clip = tiny_faceformer.animate(SPEECH, {"a": 0.3, "c": 0.7})
    assert clip.offsets.shape == (212, 42, 3)
    assert np.abs(clip.offsets).max() > 0.1
    assert (clip.codes.shape, clip.codes.dtype) == ((212, 0), np.int64)
    assert (dict(clip.parts), clip.mode) == ({"face": 0}, "exact")
    assert clip.codes_of("face").shape == (212, 0)
    clip.save(tmp_path / "talk.npz")
    again = facecode.read_clip(tmp_path / "talk.npz")
    np.testing.assert_array_equal(again.vertices, clip.vertices)
    assert (again.codes.shape, dict(again.parts)) == ((212, 0), {"face": 0})


def test_styles_differ_and_mix(tiny_faceformer, recordings):
    speech = recordings[0]
    by_style = {s: tiny_faceformer.animate(speech, s).offsets for s in "abc"}
    assert np.abs(by_style["a"] - by_style["b"]).max() > 1e-3
    alone = tiny_faceformer.animate(speech, {"b": 1.0, "c": 0.0}).offsets
    np.testing.assert_array_equal(alone, by_style["b"])


@pytest.mark.parametrize("batch_size", [1, 2, 5, 8])
def test_a_clip_in_a_batch_is_the_clip_alone(tiny_faceformer, recordings, batch_size):
    many = facecode.animate_many(recordings, "b", face=tiny_faceformer, batch_size=batch_size)
    for audio, clip in zip(recordings, many, strict=True):
        alone = tiny_faceformer.animate(audio, "b")
        assert clip.codes.shape == (len(alone.offsets), 0)
        np.testing.assert_allclose(clip.offsets, alone.offsets, atol=1e-5)


def test_blocks_are_the_clip_to_the_bit_and_come_as_they_are_made(tiny_faceformer):
    whole = tiny_faceformer.animate(SPEECH)
    blocks = list(tiny_faceformer.blocks(SPEECH))
    assert [len(block.codes) for block in blocks] == [64, 64, 64, 20]
    np.testing.assert_array_equal(np.concatenate([b.offsets for b in blocks]), whole.offsets)


def test_every_frame_is_final_at_once(tiny_faceformer, recordings):
    engine = tiny_faceformer.engine
    memories = [engine.encode(recordings[2]), engine.encode(recordings[0])]
    *steps, last = engine.frames(memories, engine.request())
    assert len(steps) == memories[0].n_frames
    assert last == Frame((), ([],))
    for step, frame in enumerate(steps):
        ((rows, hidden),) = frame.final[0]
        n_clips = sum(memory.n_frames > step for memory in memories)
        assert frame.codes[0].shape == (n_clips, 1, 0)
        assert (rows, hidden.shape) == (slice(0, n_clips), (n_clips, 1, 32))


def test_what_is_fed_back_matters(tiny_faceformer, recordings):
    """Another first second of speech is another motion in the frames that follow."""
    speech = np.concatenate([recordings[0], recordings[2]])
    other = speech.copy()
    other[:8000] = -speech[:8000][::-1]
    engine = tiny_faceformer.engine
    memory, changed = engine.encode(speech), engine.encode(other)

    class Mixed:
        n_frames = memory.n_frames

        def frame(self, step):
            return (changed if step < 10 else memory).frame(step)

    (_, want), (_, got) = (engine.move([m], engine.request())[0] for m in (memory, Mixed()))
    assert np.abs(want[0, 10] - got[0, 10]).max() > 1e-4


@pytest.mark.parametrize("length", [1.0, 20.0])
def test_auto_is_exact_at_any_length(tiny_faceformer, length):
    speech = np.resize(load_audio(SPEECH, 16_000), int(16_000 * length))
    clip = tiny_faceformer.animate(speech, mode="auto")
    assert clip.mode == "exact"
    assert len(clip.offsets) == {1.0: 29, 20.0: 599}[length]


def test_a_stream_gives_what_mode_live_gives(tiny_faceformer, recordings):
    speech = np.concatenate(recordings)
    clip = tiny_faceformer.animate(speech, "b", mode="live")
    stream = tiny_faceformer.stream("b", vertices=True)
    assert stream.latency_ms == 300  # 200 ahead and a block; no frame waits for another
    frames = [f for start in range(0, len(speech), 777) for f in stream.feed(speech[start:][:777])]
    frames += stream.finish()
    assert (clip.mode, clip.codes.shape) == ("live", (len(frames), 0))
    np.testing.assert_array_equal(clip.offsets, np.stack([f.offsets for f in frames]))
    np.testing.assert_array_equal(clip.weights, np.stack([f.weights for f in frames]))
    exact = tiny_faceformer.animate(speech, "b")
    assert len(exact.offsets) == len(clip.offsets)
    restyled = tiny_faceformer.stream("b", vertices=True)
    restyled.restyle("c", 0)
    changed = restyled.feed(speech)
    assert np.abs(changed[20].offsets - clip.offsets[20]).max() > 1e-3


def test_a_stream_looks_back_a_fixed_number_of_frames(tiny_faceformer):
    loop = tiny_faceformer.engine.loops(
        [tiny_faceformer.engine.encode(np.resize(load_audio(SPEECH, 16_000), 22 * 16_000))],
        tiny_faceformer.engine.request(window=tiny_faceformer.window("live", None)),
    )[0]
    for step in range(LONGEST_PAST + 20):
        loop.step(step, 1, {})
    past = loop._decoder._cache.inputs(1)["past_keys_0"]
    assert past.shape[2] == LONGEST_PAST


def test_weights_without_vertices(tiny_faceformer):
    assert tiny_faceformer.gives_weights
    clip = tiny_faceformer.animate(SPEECH)
    alone = tiny_faceformer.animate(SPEECH, vertices=False)
    assert (alone.offsets.shape, alone.codes.shape) == ((212, 0, 3), (212, 0))
    assert clip.weights.std(axis=0).min() > 0.01
    np.testing.assert_allclose(alone.weights, clip.weights, atol=1e-5)


@pytest.mark.parametrize("options", [{"mode": "window"}, {"window": 8}])
def test_there_is_one_mode(tiny_faceformer, options):
    with pytest.raises(
        ModeError, match="one mode for recordings, exact: leave mode and window out"
    ):
        tiny_faceformer.animate(SPEECH, **options)


def test_what_needs_codes_says_so(tiny_faceformer, recordings):
    clip = tiny_faceformer.animate(recordings[1])
    for ask in (
        lambda: tiny_faceformer.decode(clip.codes),
        lambda: tiny_faceformer.animate(recordings[1], hold={"face": clip}),
    ):
        with pytest.raises(NoCodesError, match="no codebook: this system gives motion itself"):
            ask()
    with pytest.raises(SampleError, match="expected 1 to 1"):
        tiny_faceformer.animate(recordings[1], samples=2)


def test_the_command_line(run_cli, tmp_path):
    info = run_cli("info", TINY_FACEFORMER).stdout
    assert "face (1 sample, offsets)" in info
    assert "exact: look-ahead the whole clip, frames final at once" in info
    assert "parity" in info
    assert "codes equal" not in info
    bench = run_cli("bench", TINY_FACEFORMER, "--seconds", "1", "--threads", "1")
    assert bench.returncode == 0, bench.stderr
    assert "decoder step" in bench.stdout
    assert "motion decoder" not in bench.stdout
    refused = run_cli("animate", SPEECH, "--bundle", TINY_FACEFORMER, "-o", "a.npz", "--mode",
                      "window")  # fmt: skip
    assert refused.returncode == 2
    assert "one mode for recordings, exact" in refused.stderr
    assert not (tmp_path / "a.npz").exists()
    done = run_cli("animate", SPEECH, "--bundle", TINY_FACEFORMER, "-o", "a.csv", "-o", "a.glb")
    assert done.returncode == 0, done.stderr


def test_a_part_of_both_kinds_is_refused(tmp_path):
    import shutil

    bundle = shutil.copytree(TINY_FACEFORMER, tmp_path / "bundle")
    manifest = bundle / "manifest.json"
    text = manifest.read_text()
    assert '"codebook": null' in text
    manifest.write_text(text.replace('"codebook": null', '"codebook": "template.npy"', 1))
    with pytest.raises(ManifestError, match="of kind 'offsets' has a codebook"):
        facecode.load(bundle)
