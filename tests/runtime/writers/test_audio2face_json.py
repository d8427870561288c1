"""Audio2Face's .json: names, a matrix, the rate."""

import io
import json

import numpy as np
import pytest
from small_faces import NAMES, cut, rigged, still, with_rig

from facecode.clip import Rig
from facecode.writers.audio2face_json import JSON, write_blocks_json


def written(clip):
    file = io.BytesIO()
    JSON.write(clip, file, False)
    return file.getvalue()


def test_the_object_holds_the_clip():
    clip = rigged(7, fps=25.0)
    found = json.loads(written(clip))
    assert list(found) == [
        "exportFps", "trackPath", "numPoses", "numFrames", "facsNames", "weightMat",
    ]  # fmt: skip
    assert (found["exportFps"], found["numFrames"], found["numPoses"]) == (25.0, 7, len(NAMES))
    assert found["facsNames"] == list(NAMES)
    assert np.abs(np.array(found["weightMat"]) - clip.weights).max() <= 1e-6


def test_names_with_odd_characters_come_back():
    clip = rigged(1)
    names = ('say "ah"', "backslash\\", "näme\n")
    found = json.loads(written(with_rig(clip, Rig(names, clip.rig.deltas[:3]))))
    assert found["facsNames"] == list(names)


@pytest.mark.parametrize("cuts", [[1, 2, 3, 4], [0, 3, 0, 4], [1] * 7])
def test_bytes_do_not_depend_on_the_blocks(cuts):
    clip, file = rigged(sum(cuts)), io.BytesIO()
    write_blocks_json(still(clip), clip.n_frames, cut(clip, cuts), file)
    assert file.getvalue() == written(clip)


def test_no_frame_is_an_empty_matrix():
    assert json.loads(written(still(rigged(1))))["weightMat"] == []
