"""A bundle beside people: beside itself it agrees, and beside another it does not."""

import json

import numpy as np
import pytest
from test_tracks import write_tracks

import facecode
from facecode.audio import load_audio
from facecode_exporter.cli.main import main
from facecode_exporter.data.tracks import read_tracks
from facecode_exporter.errors import EvaluationError
from facecode_exporter.evaluation.people import judge_people


def gap_of(clip):
    upper, lower = clip.lip_pair
    return 1000 * np.linalg.norm(clip.vertices[:, upper] - clip.vertices[:, lower], axis=1)


@pytest.fixture(scope="module")
def face():
    return facecode.load(threads=1)


@pytest.fixture(scope="module")
def people(tmp_path_factory, face):
    """Two clips whose person moves as the packaged model does, with lips 2 mm further apart."""
    folder = tmp_path_factory.mktemp("people") / "made"
    speakers = ["s1", "s1"]
    write_tracks(folder, [np.zeros(20), np.zeros(20)], speakers)
    tracks = [*read_tracks(folder, "validation"), *read_tracks(folder, "train")]
    gaps = []
    for track in tracks:
        clip = face.animate(load_audio(track.sound, 16_000), mode="exact")
        shown = np.arange(clip.n_frames) / clip.fps
        gaps.append(np.interp((np.arange(20) + 0.5) / 25, shown, gap_of(clip) + 2))
    write_tracks(folder, gaps, speakers)
    return folder


def test_a_model_agrees_with_itself(face, people):
    judged = judge_people(face, read_tracks(people, "validation"), None, list)
    plain = judged.plain()
    assert plain["r"]["median"] > 0.99
    mine, theirs = plain["model"], plain["people"]
    upper, lower = face.bundle.lip_pair
    neutral = 1000 * np.linalg.norm(face.bundle.template[upper] - face.bundle.template[lower])
    apart = theirs["gap at rest, mm"] - mine["gap at rest, mm"]
    assert apart == pytest.approx(2 + neutral, abs=0.1)
    assert mine["speed p95, 1/s"] == pytest.approx(theirs["speed p95, 1/s"], rel=0.2)


def test_command_line(people, tmp_path, capsys):
    picture, numbers = tmp_path / "people.png", tmp_path / "people.json"
    asked = ["evaluate", "people", "--data", str(people), "--split", "validation", "--quiet"]
    assert main([*asked, "--plot", str(picture), "--json", str(numbers)]) == 0
    shown = capsys.readouterr().out
    assert "r of the gap with the person's" in shown
    found = json.loads(numbers.read_text())
    assert found["clips"] == 1
    assert found["r"]["median"] > 0.99
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main([*asked[:-2], "test", "--quiet"]) == 2
    assert "no clip" in capsys.readouterr().err


def test_a_bundle_without_a_lip_pair(people, tiny):
    with pytest.raises(EvaluationError, match="lip-pair"):
        judge_people(tiny, read_tracks(people, "validation"), None, list)
