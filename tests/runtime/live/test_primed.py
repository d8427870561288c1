"""Every stream begins as if it had been primed for it alone; the bundle may choose with what."""

import dataclasses
import hashlib
import shutil

import numpy as np
import pytest
from conftest import SPEECH, TINY, TINY_FACEFORMER

import facecode
from facecode.audio import load_audio
from facecode.errors import ManifestError
from facecode.live import primed
from facecode.live.loop import LiveLoop
from facecode.live.plan import Plan
from facecode.live.primed import PrimedLoops
from facecode_spec.entries import FileEntry
from facecode_spec.live import LiveEntry
from facecode_spec.manifest import MANIFEST_NAME, Manifest

RATE = 16_000


@pytest.fixture(scope="module")
def face():
    return facecode.load(threads=1)


@pytest.fixture(scope="module")
def wave():
    return load_audio(SPEECH, RATE)[:30_000]


def pieces(loop, waveform):
    return [*loop.hear(waveform), loop.end()]


def same(ones, others):
    assert len(ones) == len(others) > 2
    for one, other in zip(ones, others, strict=True):
        assert (one.first, one.levels) == (other.first, other.levels)
        assert np.array_equal(one.codes, other.codes)
        assert all(map(np.array_equal, one.hidden, other.hidden))


def live_request(face, style):
    return face.request(style, {"mode": "live", "vertices": False})


@pytest.mark.parametrize("name", ["demo", "diverse", "tiny", "faceformer"])
def test_a_copy_is_as_good_as_a_loop_primed_anew(name, wave):
    where = {"tiny": TINY, "faceformer": TINY_FACEFORMER}.get(name, name)
    face = facecode.load(where, threads=1)
    request, plan = face.request(None, {"mode": "live"}), Plan.of(face.manifest)
    primer = load_audio(SPEECH, RATE)[: 3 * RATE]
    loops = PrimedLoops(face.engine, primer)
    expected = pieces(LiveLoop(face.engine, request, plan, primer), wave)
    first, second = loops.loop(request, plan), loops.loop(request, plan)
    same(pieces(first, wave), expected)
    same(pieces(second, wave), expected)  # what the first one heard does not reach it
    same(pieces(loops.loop(request, plan), wave), expected)


def test_graphs_are_not_copied(face):
    loops = PrimedLoops(face.engine, load_audio(SPEECH, RATE)[:RATE])
    loop = loops.loop(live_request(face, None), Plan.of(face.manifest))
    assert loop._parts is face.engine.parts
    (part,) = loop._loops
    assert part._codebook is face.engine.parts[0].codebook
    assert part._motion._decoder is face.engine.parts[0].motion
    assert loop.memory._encoder is face.engine.speech_encoder


def test_each_style_and_plan_is_primed_once_and_few_are_kept(face, monkeypatch):
    primings = []

    class Counted(LiveLoop):
        def __init__(self, engine, request, plan, primer):
            primings.append((request.weights.argmax(), plan.look_ahead))
            super().__init__(engine, request, plan, primer)

    monkeypatch.setattr(primed, "LiveLoop", Counted)
    monkeypatch.setattr(primed, "MOST_KEPT", 2)
    loops = PrimedLoops(face.engine, load_audio(SPEECH, RATE)[:RATE])

    def begin(style, look_ahead_ms):
        loops.loop(live_request(face, style), Plan.of(face.manifest, look_ahead_ms))

    one, other = face.styles[:2]
    for style, ms in [(one, 200), (one, 200), (other, 200), (one, 200), (one, 100)]:
        begin(style, ms)
    assert primings == [(0, 6), (1, 6), (0, 3)]
    begin(one, 200)
    assert len(primings) == 3
    begin(other, 200)  # the least lately used one had to go
    assert len(primings) == 4


@pytest.fixture
def bundle(tmp_path):
    """A copy of the tiny bundle, and what gives it a primer."""
    folder = shutil.copytree(TINY, tmp_path / "bundle")

    def with_primer(samples, **choices):
        np.save(folder / "primer.npy", samples)
        data = (folder / "primer.npy").read_bytes()
        m = Manifest.from_json((TINY / MANIFEST_NAME).read_text())
        entry = FileEntry(len(data), hashlib.sha256(data).hexdigest())
        live = {"context_s": 1.0, "block_s": 0.1, "delay_frames": 1, "look_ahead_ms": 200.0}
        m = dataclasses.replace(
            m,
            live=LiveEntry(**(live | choices), primer="primer.npy"),
            files={**m.files, "primer.npy": entry},
        )
        (folder / MANIFEST_NAME).write_text(m.to_json())
        return folder

    return with_primer


def test_a_bundle_brings_its_primer_and_plan(bundle, wave):
    primer = load_audio(SPEECH, RATE)[: 3 * RATE]
    chosen = {"context_s": 2.0, "block_s": 0.2, "delay_frames": 2, "look_ahead_ms": 400.0}
    stream = facecode.load(bundle(primer, **chosen), threads=1).stream()
    plan = stream.plan
    fps = plan.fps
    assert (plan.block, plan.delay) == (round(0.2 * fps), 2)
    assert plan.look_ahead_ms == pytest.approx(400, abs=500 / fps)
    assert 2 * fps <= plan.context < 2 * fps + 12
    assert stream.latency_ms == 1000 * (plan.look_ahead + plan.block + 2) / fps
    shown = stream.feed(wave) + stream.finish()
    clip = facecode.load(bundle(primer, **chosen), threads=1).animate(wave, mode="live")
    assert np.array_equal(clip.codes, np.stack([f.codes for f in shown]))
    other = facecode.load(bundle(primer[:RATE], **chosen), threads=1).animate(wave, mode="live")
    assert not np.array_equal(clip.offsets, other.offsets)


def test_the_same_primer_and_plan_as_the_runtimes_change_nothing(bundle, wave):
    chosen = facecode.load(bundle(load_audio(SPEECH, RATE)[: 3 * RATE]), threads=1)
    mine = facecode.load(TINY, threads=1)
    one, other = (face.animate(wave, mode="live") for face in (chosen, mine))
    assert np.array_equal(one.codes, other.codes)
    assert np.array_equal(one.offsets, other.offsets)


@pytest.mark.parametrize(
    "samples",
    [
        np.zeros(RATE + 1, np.float32),
        np.zeros(0, np.float32),
        np.zeros(31 * RATE, np.float32),
        np.full(RATE, np.nan, np.float32),
        np.zeros(RATE, np.float64),
    ],
)
def test_a_primer_that_is_none(bundle, samples):
    face = facecode.load(bundle(samples), threads=1)
    with pytest.raises(ManifestError, match=r"primer\.npy"):
        face.stream()
