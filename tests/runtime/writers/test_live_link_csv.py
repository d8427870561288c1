"""Live Link Face's .csv: the header of a real take, timecodes of 60, weights by column."""

import io

import numpy as np
import pytest
from conftest import SPEECH
from small_faces import cut, rigged, still, with_rig

import facecode
from facecode.clip import Rig
from facecode.errors import NoRigError, UnitNamesError
from facecode.writers.arkit import NAMES, pascal
from facecode.writers.live_link_csv import CSV, HEADER, timecode, write_blocks_csv

# The first line of a recording by the app, as published takes have it.
REAL = (
    "Timecode,BlendShapeCount,EyeBlinkLeft,EyeLookDownLeft,EyeLookInLeft,EyeLookOutLeft,"
    "EyeLookUpLeft,EyeSquintLeft,EyeWideLeft,EyeBlinkRight,EyeLookDownRight,EyeLookInRight,"
    "EyeLookOutRight,EyeLookUpRight,EyeSquintRight,EyeWideRight,JawForward,JawRight,JawLeft,"
    "JawOpen,MouthClose,MouthFunnel,MouthPucker,MouthRight,MouthLeft,MouthSmileLeft,"
    "MouthSmileRight,MouthFrownLeft,MouthFrownRight,MouthDimpleLeft,MouthDimpleRight,"
    "MouthStretchLeft,MouthStretchRight,MouthRollLower,MouthRollUpper,MouthShrugLower,"
    "MouthShrugUpper,MouthPressLeft,MouthPressRight,MouthLowerDownLeft,MouthLowerDownRight,"
    "MouthUpperUpLeft,MouthUpperUpRight,BrowDownLeft,BrowDownRight,BrowInnerUp,BrowOuterUpLeft,"
    "BrowOuterUpRight,CheekPuff,CheekSquintLeft,CheekSquintRight,NoseSneerLeft,NoseSneerRight,"
    "TongueOut,HeadYaw,HeadPitch,HeadRoll,LeftEyeYaw,LeftEyePitch,LeftEyeRoll,RightEyeYaw,"
    "RightEyePitch,RightEyeRoll"
)


def rows(clip):
    file = io.BytesIO()
    CSV.write(clip, file, False)
    header, *lines = file.getvalue().decode().split("\n")
    assert header == HEADER
    assert lines.pop() == ""
    return [line.split(",") for line in lines]


def test_the_header_is_that_of_a_real_take():
    assert HEADER == REAL


def test_every_weight_is_in_the_column_of_its_name():
    face = facecode.load("demo", threads=1)
    clip = face.animate(SPEECH, mode="window")
    found = rows(clip)
    assert len(found) == clip.n_frames
    header = HEADER.split(",")
    for unit, weights in zip(clip.weight_names, clip.weights.T, strict=True):
        column = [float(row[header.index(pascal(unit))]) for row in found]
        assert np.abs(np.array(column) - weights).max() <= 5e-11
    assert {row[1] for row in found} == {"61"}
    assert {cell for row in found for cell in row[54:]} == {"0.0000000000"}


@pytest.mark.parametrize(
    ("index", "fps", "want"),
    [
        (0, 30.0, "00:00:00:00.000"),
        (1, 30.0, "00:00:00:02.000"),
        (31, 30.0, "00:00:01:02.000"),
        (1, 25.0, "00:00:00:02.400"),
        (24, 25.0, "00:00:00:57.600"),
        (1, 29.97, "00:00:00:02.002"),
        (108000 + 30 * 61, 30.0, "01:01:01:00.000"),
    ],
)
def test_timecode_counts_60_frames_a_second(index, fps, want):
    assert timecode(index, fps) == want


def test_units_in_another_case_are_found_and_those_that_lack_are_zero():
    clip = rigged(3)
    rig = Rig(("JAWOPEN", "mine"), clip.rig.deltas[:2])
    clip = with_rig(clip, rig)
    place = 2 + NAMES.index("jawOpen")
    found = np.array([row[2:54] for row in rows(clip)], np.float64)
    assert np.abs(found[:, place - 2] - clip.weights[:, 0]).max() <= 5e-11
    assert not np.delete(found, place - 2, axis=1).any()


def test_a_rig_without_any_unit_of_arkits_is_refused():
    clip = rigged(3)
    clip = with_rig(clip, Rig(("mine",), clip.rig.deltas[:1]))
    with pytest.raises(UnitNamesError, match="got mine"):
        rows(clip)
    with pytest.raises(NoRigError):
        rows(with_rig(clip, None))


@pytest.mark.parametrize("cuts", [[1, 2, 3, 4], [7], [0, 3, 0, 4], [1] * 7])
def test_bytes_do_not_depend_on_the_blocks(cuts):
    clip, file, whole = rigged(sum(cuts)), io.BytesIO(), io.BytesIO()
    write_blocks_csv(still(clip), clip.n_frames, cut(clip, cuts), file)
    CSV.write(clip, whole, False)
    assert file.getvalue() == whole.getvalue()
