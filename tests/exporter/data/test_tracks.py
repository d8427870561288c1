"""Tracked speech: splits, scale, and folders that are not in order."""

import json

import numpy as np
import pytest
import soundfile

from facecode_exporter.data.tracks import CORNERS, EYE_CORNERS, LOWER_LIP, UPPER_LIP, read_tracks
from facecode_exporter.errors import DataSetError

INDEX = [0, UPPER_LIP, LOWER_LIP, *CORNERS, *EYE_CORNERS]
N_FRAMES, FPS = 20, 25.0


def write_tracks(folder, gaps, speakers, eyes_px=90.0, seconds=0.8, phones=None):
    """A folder of clips whose gap in mm, at 90 mm between the eyes, is `gaps`: one a speaker."""
    folder.mkdir(exist_ok=True)
    names = [f"{speaker}_c{i:02d}" for i, speaker in enumerate(speakers)]
    points = []
    for gap in gaps:
        rows = np.zeros((len(gap), len(INDEX), 3))
        scale = eyes_px / 90
        rows[:, INDEX.index(LOWER_LIP), 1] = gap * scale
        rows[:, INDEX.index(CORNERS[1]), 0] = 45 * scale
        rows[:, INDEX.index(EYE_CORNERS[1]), 0] = eyes_px
        points.append(rows)
    lengths = np.array([len(gap) for gap in gaps])
    np.savez(
        folder / "made_tracks.npz",
        landmarks_px32=np.round(32 * np.concatenate(points)).astype(np.int16),
        landmark_index=np.array(INDEX),
        start=np.concatenate([[0], lengths.cumsum()[:-1]]),
        length=lengths,
        clip=np.array([name.partition("_")[2] for name in names]),
        speaker=np.array(speakers),
        fps=np.array(FPS),
    )
    said = {name: phones or [["SIL", 0.0, 0.4, "-"], ["P", 0.4, 0.5, "pa"]] for name in names}
    (folder / "phones.json").write_text(json.dumps(said))
    for name in names:
        rng = np.random.default_rng(0)
        sound = 0.1 * rng.standard_normal(int(16_000 * seconds))
        soundfile.write(folder / f"{name}.wav", sound, 16_000)
    return names


@pytest.fixture
def folder(tmp_path):
    speakers = ["s2", *["s1"] * 21, "s3"]
    gaps = [np.linspace(0, 10, N_FRAMES) + i for i in range(len(speakers))]
    write_tracks(tmp_path / "people", gaps, speakers)
    return tmp_path / "people"


def test_splits_of_the_speaker_with_the_most_clips(folder):
    names = {
        split: [t.name for t in read_tracks(folder, split)]
        for split in ("train", "validation", "test", "others")
    }
    own = [f"s1_c{i:02d}" for i in range(1, 22)]
    assert names["validation"] == own[::10]
    assert names["test"] == own[5::10]
    assert names["others"] == ["s2_c00", "s3_c22"]
    assert sorted(names["train"] + names["validation"] + names["test"]) == own


@pytest.mark.parametrize("eyes_px", [60.0, 90.0, 200.0])
def test_millimetres_do_not_depend_on_the_film(tmp_path, eyes_px):
    gap = np.linspace(0, 10, N_FRAMES)
    write_tracks(tmp_path / "film", [gap], ["s1"], eyes_px)
    (track,) = read_tracks(tmp_path / "film", "validation")
    np.testing.assert_allclose(track.gap_mm, gap, atol=0.05)
    np.testing.assert_allclose(track.width_mm, 45, atol=0.05)
    assert track.phones[1].name == "P"


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda f: (f / "phones.json").unlink(), "phones"),
        (lambda f: (f / "other_tracks.npz").write_bytes(b"x"), "2 files"),
        (lambda f: (f / "made_tracks.npz").write_bytes(b"x"), "form"),
        (lambda f: (f / "phones.json").write_text("{"), "form"),
        (lambda f: np.savez(f / "made_tracks.npz", clip=np.array(["a"])), "form"),
        (lambda f: (f / "s1_c06.wav").unlink(), "s1_c06"),
    ],
)
def test_folders_that_are_not_in_order(folder, spoil, says):
    spoil(folder)
    with pytest.raises(DataSetError, match=says):
        read_tracks(folder, "test")


def test_an_unknown_split(folder):
    with pytest.raises(DataSetError, match="validation"):
        read_tracks(folder, "tset")
