"""The page in Debian's Chromium: what it shows, plays, saves and asks of the network."""

import base64
import dataclasses
import io
import json

import numpy as np
import pytest
from conftest import SPEECH
from gltf_clients import HERE, chromium, node_modules, run
from numpy.lib.stride_tricks import sliding_window_view
from PIL import Image

import facecode
from facecode import writers
from facecode.writers.glb import GLB

pytestmark = pytest.mark.clients
FRAMES = [0, 36, 60, 105, 210]


def opened(clips, folder):
    """What the page of the clips does in the browser."""
    modules, browser = node_modules(), chromium()
    writers.save(clips if len(clips) > 1 else clips[0], folder / "talk.html")
    (folder / "asked.json").write_text(json.dumps({"frames": FRAMES, "faces": len(clips)}))
    files = (folder / "talk.html", folder / "asked.json", folder / "page.png")
    return json.loads(run("node", HERE / "page_check.mjs", modules, browser, *files))


def check(found, clips):
    """Everything but the distances of vertices in metres, which are given."""
    assert found["frames"] == clips[0].n_frames
    assert (found["requests"], found["errors"]) == ([], [])
    assert abs(found["rate"] - 30) < 3  # frames a second, in step with the sound's clock
    assert found["pressed"] == "true"
    assert found["paused"] == 0
    assert found["sought"] == pytest.approx(FRAMES[-1], abs=0.01)
    assert found["turned_by_key"]
    assert found["played_by_touch"] > 5
    assert not found["wider_than_the_phone"]
    assert "WebGL 2" in found["without_webgl"]
    glb = io.BytesIO()
    writers.write(clips if len(clips) > 1 else clips[0], glb, GLB)
    assert base64.b64decode(found["saved"]) == glb.getvalue()
    errors = []
    for shown, clip in zip(found["positions"], clips, strict=True):
        positions = np.reshape(shown, (len(FRAMES), -1, 3))
        errors.append(np.linalg.norm(positions - clip.vertices[FRAMES], axis=2))
        print(f"mean {1000 * errors[-1].mean():.4f} mm, largest {1000 * errors[-1].max():.3f} mm")
    return errors


def specks(path):
    """Pixels that are darker than all around them on an even stretch of skin: (n, 2) row, column.

    In the lower half of the head, where the inside of the mouth lies behind the skin.
    """
    grey = np.asarray(Image.open(path).convert("RGB"), np.int64).sum(axis=2)
    skin = grey[300:560, 300:660]
    around = sliding_window_view(np.pad(skin, 1, mode="edge"), (3, 3)).reshape(*skin.shape, 9)
    middle = np.median(around, axis=2)
    wide = sliding_window_view(np.pad(middle, 2, mode="edge"), (5, 5)).reshape(*skin.shape, 25)
    even = np.ptp(wide, axis=2) < 40
    assert even.mean() > 0.3
    return np.argwhere(even & (middle - skin > 25))


def test_the_packaged_sentence(tmp_path):
    clip = facecode.load("demo", threads=1).animate(SPEECH)
    (error,) = check(opened([clip], tmp_path), [clip])
    assert not len(specks(tmp_path / "page.png"))
    assert error.mean() < 2e-5
    assert error.max() < 6e-4
    assert (tmp_path / "talk.html").stat().st_size <= 1.7e6


def test_two_faces_side_by_side_without_sound(tmp_path):
    takes = facecode.load("diverse", threads=1).animate(SPEECH, samples=2, mode="window")
    clips = [dataclasses.replace(clip, audio=None) for clip in takes]
    for error in check(opened(clips, tmp_path), clips):
        assert error.mean() < 1e-4
