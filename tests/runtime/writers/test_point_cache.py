"""Point caches: what a reader of their layout finds."""

import io
import struct

import numpy as np
import pytest
from small_faces import changed, cut, rigged, still

from facecode.writers.point_cache import MDD, PC2

FORMATS = (PC2, MDD)


def written(found, clip):
    file = io.BytesIO()
    found.write(clip, file, False)
    return file.getvalue()


def read_pc2(data):
    magic, version, n_points, start, rate, n_frames = struct.unpack("<12siiffi", data[:32])
    assert (magic, version, start, rate) == (b"POINTCACHE2\0", 1, 0.0, 1.0)
    return np.frombuffer(data[32:], "<f4").reshape(n_frames, n_points, 3)


def read_mdd(data, fps):
    n_frames, n_points = struct.unpack(">ii", data[:8])
    times = np.frombuffer(data[8 : 8 + 4 * n_frames], ">f4")
    assert np.array_equal(times, np.float32(np.arange(n_frames) / fps))
    return np.frombuffer(data[8 + 4 * n_frames :], ">f4").reshape(n_frames, n_points, 3)


def test_points_are_the_clips():
    clip = rigged(7, fps=25.0)
    assert np.array_equal(read_pc2(written(PC2, clip)), clip.vertices)
    assert np.array_equal(read_mdd(written(MDD, clip), 25.0), clip.vertices)


def test_points_are_in_metres_and_y_up():
    clip = rigged(2)
    turned = changed(clip, metres_per_unit=0.01, up_axis="z", rig=None, faces=None)
    found = read_pc2(written(PC2, turned))
    x, y, z = np.moveaxis(clip.vertices * np.float32(0.01), 2, 0)
    assert np.array_equal(found, np.stack([x, z, -y], axis=-1))


@pytest.mark.parametrize("found", FORMATS, ids=lambda f: f.suffix)
@pytest.mark.parametrize("cuts", [[1, 2, 3, 4], [0, 3, 0, 4], [1] * 7])
def test_bytes_do_not_depend_on_the_blocks(found, cuts):
    clip, file = rigged(sum(cuts)), io.BytesIO()
    found.write_blocks(still(clip), clip.n_frames, cut(clip, cuts), file)
    assert file.getvalue() == written(found, clip)
