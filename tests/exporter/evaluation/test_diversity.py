"""APD, UPD, LPD, MPD and ALVE on faces whose distances are known, and from the command line."""

import dataclasses
import json

import numpy as np
import pytest
import soundfile
from conftest import make_folder

from facecode.animator import Animator
from facecode.bundle import Bundle
from facecode_exporter.bundles.neutral import read_neutral
from facecode_exporter.bundles.writer import write_bundle
from facecode_exporter.cli.main import main
from facecode_exporter.data.recordings import Recording
from facecode_exporter.errors import EvaluationError
from facecode_exporter.evaluation.code_sampling import DrawnCodebook, drawing, drawn_faces
from facecode_exporter.evaluation.diversity import diversity_score, mean_score
from facecode_exporter.evaluation.speech import judge_speech, measure
from facecode_exporter.measures.metrics import lip_vertex_error
from facecode_exporter.measures.phone import Phone
from facecode_exporter.measures.regions import Regions
from facecode_exporter.random_weights import random_network
from facecode_spec.systems import SYSTEMS

TINY = SYSTEMS["cdface-tiny"]
REGIONS = Regions(np.array([0, 1], np.int32), np.array([2], np.int32))


def test_known_distances():
    truth = np.zeros((4, 3, 3))
    faces = np.zeros((3, 4, 3, 3))
    faces[1, :, 0, 0] = 3  # lips: 3 in each of 4 frames
    faces[2, :, 2, 1] = 4  # upper face
    score = diversity_score(faces, truth, REGIONS)
    assert score.lpd == pytest.approx((6 + 0 + 6) / 3)
    assert score.upd == pytest.approx((0 + 8 + 8) / 3)
    assert score.apd == pytest.approx((6 + 8 + 10) / 3)
    assert score.mpd == pytest.approx(6)
    assert score.alve == pytest.approx((0 + 9 + 0) / 3)
    assert score.best_lve == 0
    assert mean_score([score, score]) == score
    same = diversity_score(faces[[1, 1]], truth, REGIONS)
    assert (same.apd, same.mpd) == (0, 0)
    with pytest.raises(EvaluationError, match="two or more"):
        diversity_score(faces[:1], truth, REGIONS)
    longer = np.concatenate([faces, faces[:, -1:]], axis=1)
    assert diversity_score(longer, truth, REGIONS) == score


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    system = dataclasses.replace(
        TINY, parts=tuple(dataclasses.replace(p, n_samples=3) for p in TINY.parts)
    )
    own = np.arange(42, dtype=np.int32)
    regions = {"lips": own[:9], "upper_face": own[20:30]}
    neutral = dataclasses.replace(
        read_neutral(None, 42),
        given=True,
        parts={"lips": own[:17], "upper_face": own[17:]},
        regions=regions,
        lip_pair=(1, 3),
    )
    out = tmp_path_factory.mktemp("diverse") / "bundle"
    write_bundle(random_network(system, seed=2), out, neutral, sources={})
    return out


def test_face_k_has_sample_k_of_every_part(bundle, speech):
    animator = Animator(Bundle.open(bundle))
    audio = speech[0][:9000]
    faces = animator.animate(audio, samples=3)
    every = animator.animate(audio, samples={"lips": 3, "upper_face": 3})
    for k, face in enumerate(faces):
        np.testing.assert_array_equal(face.codes, every[4 * k].codes)
    held = animator.animate(audio, samples=3, hold={"lips": faces[0]})
    assert len(held) == 3
    assert all(np.array_equal(f.codes_of("lips"), faces[0].codes_of("lips")) for f in held)


@pytest.mark.parametrize("hold", [None, "lips"])
def test_from_the_command_line(bundle, tmp_path, hold):
    data = make_folder(tmp_path / "data", "vocaset", 42)
    args = ["evaluate", "diversity", str(bundle), "--data", str(data), "--dataset", "vocaset"]
    args += ["--split", "validation", "--samples", "3", "--json", str(tmp_path / "n.json")]
    args += ["--hold", hold] if hold else ["--plots", str(tmp_path)]
    assert main([*args, "--quiet"]) == 0
    mean = json.loads((tmp_path / "n.json").read_text())["mean"]
    assert mean["upd"] > 0
    assert (mean["lpd"] == 0) == (hold == "lips")
    assert mean["alve"] >= mean["best_lve"] > 0
    assert hold or list(tmp_path.glob("*_lip_distances.png"))


def test_score_is_that_of_evaluate_bundle():
    rng = np.random.default_rng(0)
    faces, truth = rng.random((2, 5, 3, 3)), rng.random((5, 3, 3))
    want = [lip_vertex_error(f, truth, REGIONS.lips) for f in faces]
    score = diversity_score(faces, truth, REGIONS)
    assert (score.alve, score.best_lve) == (np.mean(want), min(want))


def test_codes_are_drawn_by_their_distance():
    rows = np.array([[0.0], [1.0], [3.0]], np.float32)
    features = np.full((20_000, 1), 0.5, np.float32)
    drawn = DrawnCodebook(rows, 2.0, np.random.default_rng(0)).nearest(features)
    odds = np.exp(-np.array([0.25, 0.25, 6.25]) / 2)
    np.testing.assert_allclose(np.bincount(drawn) / len(drawn), odds / odds.sum(), atol=0.01)
    nearest = DrawnCodebook(rows, 0.0, np.random.default_rng(0)).nearest(features + 0.1)
    assert (nearest == 1).all()


def test_drawn_faces_differ_and_without_tau_are_the_model(tiny, speech):
    animator = tiny
    audio, neutral = speech[0][:9000], animator.bundle.template
    want = animator.animate(audio).vertices
    same = drawn_faces(animator, drawing(animator, 0.0), audio, None, neutral, 2)
    np.testing.assert_allclose(same, np.stack([want, want]), atol=1e-6)
    first, second = drawn_faces(animator, drawing(animator, 100.0), audio, None, neutral, 2)
    assert not np.array_equal(first, second)


def test_a_model_with_samples_is_no_baseline(bundle):
    with pytest.raises(EvaluationError, match="no samples of its own"):
        drawing(Animator(Bundle.open(bundle)), 1.0)


def test_speech_of_every_face_is_judged(bundle, tmp_path, speech):
    """Against each face alone."""
    animator = Animator(Bundle.open(bundle))
    soundfile.write(tmp_path / "a.wav", speech[0][:16000], speech[1])
    phones = [Phone("P", 0.2, 0.3), Phone("AA", 0.3, 0.5), Phone("SIL", 0.5, 1.0)]
    recording = Recording("a", tmp_path / "a.wav", speech[0][:16000], phones)
    clips = list(judge_speech(animator, [recording], [TINY.styles[0]], (1, 3), iter, samples=3))
    assert [clip.style for clip in clips] == [f"{TINY.styles[0]}-{k}" for k in range(3)]
    for clip, face in zip(
        clips, animator.animate(recording.path, TINY.styles[0], samples=3), strict=True
    ):
        alone = measure(face, recording, clip.style, (1, 3))
        np.testing.assert_array_equal(clip.relative, alone.relative)
    (one,) = judge_speech(animator, [recording], [TINY.styles[0]], (1, 3), iter)
    np.testing.assert_allclose(one.relative, clips[0].relative, atol=1e-4)  # rows of one batch
