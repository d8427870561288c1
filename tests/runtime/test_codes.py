"""Codes in, motion out; codes held; samples that a bundle does not give."""

import numpy as np
import pytest
from conftest import SPEECH, TINY

from facecode.cli.hold_option import parse_hold
from facecode.errors import CodesError, ModeError, SampleError


@pytest.fixture(scope="module")
def clip(tiny):
    return tiny.animate(SPEECH)


def test_codes_decode_to_the_motion_they_came_with(tiny, clip):
    np.testing.assert_allclose(tiny.decode(clip.codes), clip.offsets, atol=1e-6)
    twice = tiny.decode(np.stack([clip.codes[:50], clip.codes[:50]]))
    assert twice.shape == (2, 50, 42, 3)
    np.testing.assert_allclose(twice[0], tiny.decode(clip.codes[:50]), atol=1e-5)


def test_edited_codes_change_the_motion(tiny, clip):
    edited = clip.codes.copy()
    edited[30:60] = edited[0]
    assert np.abs(tiny.decode(edited) - clip.offsets)[30:60].max() > 1e-3


def test_held_codes_are_kept(tiny, clip):
    kept = (clip.codes + 1) % len(tiny.engine.parts[0].codebook.rows)
    held = tiny.animate(SPEECH, hold={"face": kept})
    np.testing.assert_array_equal(held.codes, kept)
    np.testing.assert_allclose(held.offsets, tiny.decode(kept), atol=1e-6)
    np.testing.assert_array_equal(tiny.animate(SPEECH, hold={"face": clip}).codes, clip.codes)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda c: c[:, :-1],
        lambda c: c.astype(np.float32),
        lambda c: c - 100,
        lambda c: c + 100_000,
        lambda c: c[0],
    ],
)
def test_codes_that_are_none_of_the_bundle(tiny, clip, wrong):
    with pytest.raises(CodesError, match="expected"):
        tiny.decode(wrong(clip.codes))


def test_codes_of_another_length_are_not_held(tiny, clip):
    with pytest.raises(CodesError, match="211 frames"):
        tiny.animate(SPEECH, hold={"face": clip.codes[1:]})
    with pytest.raises(ModeError, match="face"):
        tiny.animate(SPEECH, hold={"lips": clip.codes})


def test_samples_of_a_face_that_has_one(tiny, clip):
    takes = tiny.animate(SPEECH, samples=1)
    assert (len(takes), takes.offsets.shape, takes.diversity()) == (1, (1, 212, 42, 3), 0.0)
    np.testing.assert_array_equal(takes[0].codes, clip.codes)
    for samples in (2, 0, {"lips": 2}, {"face": 2}):
        with pytest.raises(SampleError):
            tiny.animate(SPEECH, samples=samples)


def test_codes_from_a_file_are_held(run_cli, tmp_path, clip):
    clip.save(tmp_path / "take.npz")
    done = run_cli(
        "animate", SPEECH, "--bundle", TINY, "-o", "held.npz", "--hold", "face=take.npz#0",
        "--style", "b",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    with np.load(tmp_path / "held.npz") as held:
        np.testing.assert_array_equal(held["codes"], clip.codes)


@pytest.mark.parametrize("text", ["face", "face=", "=a.npz", "face=a.npz#x", "face=none.npz"])
def test_holds_that_cannot_be_read(text):
    with pytest.raises(CodesError):
        parse_hold(text)


def test_a_face_number_that_is_not_there(clip, tmp_path):
    clip.save(tmp_path / "take.npz")
    with pytest.raises(CodesError, match="no number 3"):
        parse_hold(f"face={tmp_path / 'take.npz'}#3")
