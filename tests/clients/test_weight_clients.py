"""Weights as OpenFaceFX (.csv, .json) and three-vrm (.vrma) read them, frame by frame."""

import time

import numpy as np
import pytest
from gltf_clients import far, in_openfacefx, in_three_vrm, longer, node_modules, sentence, validated
from small_faces import rigged, still

from facecode import writers
from facecode.writers.arkit import pascal
from facecode.writers.live_link_csv import ROTATIONS
from facecode.writers.vrma import PRESETS

pytestmark = pytest.mark.clients

MEAN_MM, GREATEST_MM = 0.02, 0.6

READER = 5.1e-5
"""OpenFaceFX rounds weights to four decimals."""
EXACT = 1e-6
"""Weights are float32 in a .vrma, and so are its times."""


def saved(clip, path):
    """Seconds to write the file, weights known beforehand, and its size."""
    assert len(clip.weights) == clip.n_frames
    begun = time.perf_counter()
    writers.save(clip, path)
    return time.perf_counter() - begun, path.stat().st_size


def at_frames(keys, clip):
    """Values of a channel on the frames of a clip, and the farthest key from a frame."""
    frames = keys[:, 0] * clip.fps
    values = np.interp(np.arange(clip.n_frames), frames, keys[:, 1])
    return values, np.abs(frames - frames.round()).max()


@pytest.mark.parametrize("seconds", [None, 60])
@pytest.mark.parametrize(("suffix", "spelled"), [(".csv", pascal), (".json", str)])
def test_openfacefx_reads_every_weight(tmp_path, suffix, spelled, seconds):
    clip = sentence() if seconds is None else longer(sentence(), seconds)
    took, size = saved(clip, tmp_path / f"talk{suffix}")
    tracks = in_openfacefx(tmp_path / f"talk{suffix}")
    found = np.zeros_like(clip.weights)
    for column, name in enumerate(clip.weight_names):
        if spelled(name) in tracks:  # a channel that is 0 throughout is left out
            found[:, column], beside = at_frames(tracks.pop(spelled(name)), clip)
            assert beside <= 2e-3
    assert not set(tracks) - set(ROTATIONS)
    errors = np.abs(found - clip.weights)
    mean, largest = errors.mean(), errors.max()
    shown_mm = far(np.tensordot(found, clip.rig.deltas, 1), clip.offsets)
    print(f"\n{suffix}, {clip.n_frames} frames: {size} bytes, {took:.2f} s; mean, largest error "
          f"of a weight {mean:.1e} {largest:.1e}; mm {shown_mm}")  # fmt: skip
    assert largest <= READER
    assert shown_mm[0] <= MEAN_MM
    assert shown_mm[1] <= GREATEST_MM


@pytest.mark.parametrize("fps", [25.0, 60.0])
def test_the_timecode_gives_the_time_of_each_frame(tmp_path, fps):
    clip = rigged(150, fps=fps)
    saved(clip, tmp_path / "talk.csv")
    keys = in_openfacefx(tmp_path / "talk.csv")["JawOpen"]
    assert len(keys) > 100
    assert at_frames(keys, clip)[1] <= 2e-3
    assert abs(keys[-1, 0] - 149 / fps) < 1e-4


@pytest.mark.parametrize("seconds", [None, 60])
def test_an_avatar_takes_every_custom_expression(tmp_path, seconds):
    node_modules()
    clip = sentence() if seconds is None else longer(sentence(), seconds)
    path = tmp_path / "talk.vrma"
    took, size = saved(clip, path)
    assert validated(path)[0]["numErrors"] == 0
    times = np.arange(clip.n_frames)[:: 1 if seconds is None else 50]
    facts, weights = in_three_vrm(path, np.float32(times / clip.fps).tolist())
    assert facts["presets"] == []
    assert facts["custom"] == [pascal(name) for name in clip.weight_names]
    assert abs(facts["duration"] - (clip.n_frames - 1) / clip.fps) < 1e-4
    found = np.stack([weights[pascal(name)] for name in clip.weight_names], axis=1)
    largest = np.abs(found - clip.weights[times]).max()
    print(f"\n.vrma, {clip.n_frames} frames: {size} bytes, {took:.2f} s; largest error of a weight "
          f"{largest:.1e}; {facts['warnings']}")  # fmt: skip
    assert largest <= EXACT


def test_an_avatar_takes_presets(tmp_path):
    clip, path = sentence(), tmp_path / "talk.vrma"
    writers.save(clip, path, found=PRESETS)
    facts, weights = in_three_vrm(path, ["0", "1", "2"])
    assert facts["custom"] == []
    assert facts["presets"] == ["aa", "ih", "ou", "ee", "oh", "blinkLeft", "blinkRight"]
    blink = clip.weights[[0, 30, 60], clip.weight_names.index("eyeBlinkLeft")]
    assert np.abs(weights["blinkLeft"] - blink).max() <= EXACT


def test_files_of_one_frame_and_of_none_are_valid(tmp_path):
    for name, clip in {"one": rigged(1), "none": still(rigged(1))}.items():
        for suffix in (".vrma", ".csv", ".json"):
            writers.save(clip, tmp_path / f"{name}{suffix}")
    assert [each["numErrors"] for each in validated(*sorted(tmp_path.glob("*.vrma")))] == [0, 0]
    for suffix in (".csv", ".json"):
        assert in_openfacefx(tmp_path / f"none{suffix}") == {}
        keys = in_openfacefx(tmp_path / f"one{suffix}")
        jaw = next(value for name, value in keys.items() if name.casefold() == "jawopen")
        assert abs(jaw[0, 1] - rigged(1).weights[0, 1]) <= READER
