"""Landmarks to measures: whatever the scale, the place and the tilt of the head."""

import numpy as np
import pytest
from tracked_mouths import opened, write_mouth_tracks

from facecode_exporter.data.mouth_tracks import measured_mm, read_mouth_tracks
from facecode_exporter.errors import DataSetError


def test_a_gap_is_in_mm_at_any_scale_place_and_tilt():
    plain = measured_mm(opened([0, 5, 10]))
    assert plain[:, 0] == pytest.approx([0, 5, 10])
    assert plain[:, 1] == pytest.approx([50, 50, 50])
    assert plain[:, 3] == pytest.approx([-60, -65, -70])
    turn = np.array([[np.cos(0.1), -np.sin(0.1)], [np.sin(0.1), np.cos(0.1)]])
    elsewhere = 2.5 * opened([0, 5, 10]) @ turn.T + [140, 90]
    assert measured_mm(elsewhere) == pytest.approx(plain, abs=1e-9)


@pytest.fixture
def folder(tmp_path, speech):
    write_mouth_tracks(tmp_path, 2, *speech)
    return tmp_path


def test_measures_are_less_those_at_rest(folder):
    (clip,) = read_mouth_tracks(folder, "train")
    assert clip.track.name == "s1_c01"
    assert clip.measures_mm.shape == (20, 7)
    assert clip.measures_mm[:5] == pytest.approx(np.zeros((5, 7)), abs=1e-6)
    assert clip.measures_mm[-1, 0] == pytest.approx(12, abs=0.05)
    assert clip.measures_mm[-1, 3] == pytest.approx(-12, abs=0.05)
    assert clip.rounding[0, 0] == 0
    assert clip.rounding[-1, 0] == pytest.approx(0.5, abs=1e-3)


def test_tracks_without_scores_or_landmarks_say_what_a_teacher_needs(folder):
    with np.load(folder / "made_tracks.npz") as data:
        kept = dict(data)
    for missing in ("blendshapes", "blendshape_names"):
        np.savez(folder / "made_tracks.npz", **{k: v for k, v in kept.items() if k != missing})
        with pytest.raises(DataSetError, match="scores of mouthPucker, mouthFunnel"):
            read_mouth_tracks(folder, "train")
    other = np.where(kept["landmark_index"] == 152, 151, kept["landmark_index"])
    np.savez(folder / "made_tracks.npz", **(kept | {"landmark_index": other}))
    with pytest.raises(DataSetError, match="chin"):
        read_mouth_tracks(folder, "train")
