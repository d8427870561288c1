"""A recording block by block gives the files and the clips that it gives as a whole."""

import numpy as np
import pytest
from conftest import SPEECH, TINY

import facecode
from facecode.cli.main import main
from facecode.errors import CodesError, NoRigError, NoVerticesError, TakenBlocksError


@pytest.fixture(scope="module", params=["demo", "diverse"])
def face(request):
    return facecode.load(request.param, threads=1)


def long(n=3):
    import soundfile

    samples, _ = soundfile.read(SPEECH, dtype="float32")
    return np.tile(samples, n)


@pytest.mark.parametrize("mode", ["exact", "window"])
@pytest.mark.parametrize("n", [0.01, 0.3, 3])
def test_blocks_are_the_frames_of_the_clip(face, mode, n):
    audio = long()[: int(n * 113_600)]
    clip = face.animate(audio, mode=mode)
    blocks = face.blocks(audio, mode=mode)
    assert blocks.n_frames == clip.n_frames
    found = list(blocks)
    assert all(block.n_frames == 64 for block in found[:-1])
    assert 1 <= found[-1].n_frames <= 64
    assert np.array_equal(np.concatenate([b.offsets for b in found]), clip.offsets)
    assert np.array_equal(np.concatenate([b.codes for b in found]), clip.codes)
    assert blocks.still.n_frames == 0
    assert np.array_equal(blocks.still.audio, clip.audio)


@pytest.mark.parametrize("mode", ["exact", "window"])
def test_parts_that_are_held_come_block_by_block_too(mode):
    face = facecode.load("diverse", threads=1)
    takes = face.animate(SPEECH, samples=2)
    for hold in (
        {"lips": takes[1]},
        {"upper_face": takes[1]},
        dict.fromkeys(takes[1].parts, takes[1]),
    ):
        clip = face.animate(SPEECH, mode=mode, hold=hold)
        found = list(face.blocks(SPEECH, mode=mode, hold=hold))
        assert len(found) == 4
        assert np.array_equal(np.concatenate([b.offsets for b in found]), clip.offsets)
        assert np.array_equal(np.concatenate([b.codes for b in found]), clip.codes)


def test_a_block_comes_as_soon_as_its_frames_are_final(monkeypatch):
    face = facecode.load(TINY, threads=1)
    graph, asked = face.engine.parts[0].decoder_step, []
    run = graph.run
    monkeypatch.setattr(graph, "run", lambda *a, **k: (asked.append(1), run(*a, **k))[1])
    window = face.window("window", None)
    next(iter(face.blocks(SPEECH, mode="window")))
    assert len(asked) == 64 + max(window.delay, window.frames) + 1


def test_what_cannot_be_held_is_refused_before_the_first_block():
    with pytest.raises(CodesError, match="3 frames to hold"):
        facecode.load(TINY).blocks(SPEECH, hold={"face": np.zeros((3, 4), np.int64)})


@pytest.mark.parametrize("mode", ["exact", "window"])
def test_weights_without_vertices(face, mode):
    whole = face.animate(SPEECH, mode=mode)
    alone = face.animate(SPEECH, mode=mode, vertices=False)
    assert np.array_equal(alone.codes, whole.codes)
    assert np.abs(alone.weights - whole.weights).max() < 1e-6
    assert alone.weight_names == whole.weight_names
    assert alone.offsets.size == 0
    blocks = [b.weights for b in face.blocks(SPEECH, mode=mode, vertices=False)]
    assert np.array_equal(np.concatenate(blocks), alone.weights)
    with pytest.raises(NoVerticesError, match="vertices=False"):
        _ = alone.vertices


def test_samples_and_batches_without_vertices():
    face = facecode.load("diverse", threads=1)
    whole = face.animate(SPEECH, samples={"lips": 2, "upper_face": 2}, mode="window")
    alone = face.animate(
        SPEECH, samples={"lips": 2, "upper_face": 2}, mode="window", vertices=False
    )
    assert np.abs(alone.weights - whole.weights).max() < 1e-6
    (one,) = facecode.animate_many([SPEECH], face=face, mode="window", vertices=False)
    assert np.array_equal(one.weights, alone[0].weights)


@pytest.mark.parametrize("suffix", [".npz", ".pc2", ".mdd"])
def test_files_of_vertices_are_those_of_the_whole_clip(face, suffix, tmp_path):
    face.blocks(SPEECH, mode="window").save(tmp_path / f"blocks{suffix}")
    face.animate(SPEECH, mode="window").save(tmp_path / f"whole{suffix}")
    blocks, whole = ((tmp_path / f"{n}{suffix}").read_bytes() for n in ("blocks", "whole"))
    assert blocks == whole


@pytest.mark.parametrize("suffix", [".csv", ".json", ".glb", ".vrma"])
def test_files_of_weights_are_those_of_the_whole_clip(face, suffix, tmp_path):
    face.blocks(SPEECH, mode="window", vertices=False).save(tmp_path / f"blocks{suffix}")
    face.animate(SPEECH, mode="window", vertices=False).save(tmp_path / f"whole{suffix}")
    blocks, whole = ((tmp_path / f"{n}{suffix}").read_bytes() for n in ("blocks", "whole"))
    assert blocks == whole


def test_a_format_that_needs_the_whole_clip_gathers_it(tmp_path):
    tiny = facecode.load(TINY, threads=1)
    tiny.blocks(SPEECH, mode="window").save(tmp_path / "a.glb")  # no rig: components
    tiny.animate(SPEECH, mode="window").save(tmp_path / "b.glb")
    assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()


def test_what_needs_vertices_or_units_says_so(tmp_path):
    face = facecode.load("demo", threads=1)
    for suffix in (".npz", ".pc2", ".mp4"):
        with pytest.raises(NoVerticesError, match="vertices=False"):
            face.animate(SPEECH, mode="window", vertices=False).save(tmp_path / f"a{suffix}")
        with pytest.raises(NoVerticesError):
            face.blocks(SPEECH, mode="window", vertices=False).save(tmp_path / f"a{suffix}")
    assert not list(tmp_path.iterdir())
    with pytest.raises(NoRigError, match="--units"):
        facecode.load(TINY).animate(SPEECH, vertices=False)


def test_several_outputs_at_once(tmp_path):
    outputs = [str(tmp_path / f"talk{suffix}") for suffix in (".npz", ".csv", ".glb")]
    options = [x for output in outputs for x in ("-o", output)]
    assert main(["animate", str(SPEECH), *options, "--mode", "window", "--quiet"]) == 0
    assert sorted(f.name for f in tmp_path.iterdir()) == ["talk.csv", "talk.glb", "talk.npz"]
    assert main(["animate", str(SPEECH), "-o", outputs[0], "-o", "-", "--quiet"]) == 2


@pytest.mark.parametrize("suffix", [".npz", ".pc2", ".csv", ".mp4"])
def test_blocks_that_were_taken_leave_no_file_of_the_rest(suffix, tmp_path):
    blocks = facecode.load("demo", threads=1).blocks(SPEECH, mode="window")
    taken = next(iter(blocks)).n_frames
    with pytest.raises(TakenBlocksError, match=f"got {213 - taken} of 213 frames"):
        blocks.save(tmp_path / f"talk{suffix}")
    assert not list(tmp_path.iterdir())


def test_weights_alone_have_no_distance_in_metres():
    takes = facecode.load("diverse", threads=1).animate(
        SPEECH, samples=2, mode="window", vertices=False
    )
    with pytest.raises(NoVerticesError):
        takes.diversity()
