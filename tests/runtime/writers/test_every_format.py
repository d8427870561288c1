"""Every format with every kind of clip: the file holds its frames, or an error says why not."""

import base64
import json
import re

import av
import numpy as np
import pytest
from gltf_reading import Glb
from small_faces import changed, rigged

import facecode
from facecode import writers
from facecode.errors import NoRigError, OutputSuffixError

ODD = "a b 'é\u4f60#%.x"
N_FRAMES = 7


def frames_in_glb(data):
    found = Glb(data)
    sampler = found.tree["animations"][0]["samplers"][0]
    return found.tree["accessors"][sampler["input"]]["count"]


def frames_in_page(path):
    heads = re.findall(rb"Z2xURg[A-Za-z0-9+/]+=*", path.read_bytes())
    assert len(heads) == 1, "one .glb in base64"
    return frames_in_glb(base64.b64decode(heads[0]))


def frames_in_usd(path):
    usd = pytest.importorskip("pxr.Usd", reason="no usd-core: pip install '.[usd]'")
    stage = usd.Stage.Open(str(path))
    return round(stage.GetEndTimeCode() - stage.GetStartTimeCode()) + 1


def frames_in_film(path):
    with av.open(str(path)) as film:
        return sum(1 for _ in film.decode(video=0))


FRAMES = {
    ".npz": lambda path: np.load(path)["vertices"].shape[-3],
    ".mp4": frames_in_film,
    ".glb": lambda path: frames_in_glb(path.read_bytes()),
    ".html": frames_in_page,
    ".csv": lambda path: len(path.read_text().splitlines()) - 1,
    ".json": lambda path: json.loads(path.read_text())["numFrames"],
    ".usda": frames_in_usd,
    ".usdz": frames_in_usd,
    ".usdc": frames_in_usd,
    ".vrma": lambda path: frames_in_glb(path.read_bytes()),
    ".pc2": lambda path: int.from_bytes(path.read_bytes()[28:32], "little"),
    ".mdd": lambda path: int.from_bytes(path.read_bytes()[:4], "big"),
}
"""By suffix, how many frames a file says it has."""
WEIGHTS = {".csv", ".json", ".vrma"}
ONE_FACE = WEIGHTS | {".pc2", ".mdd"}
SPOKEN = rigged(audio=np.zeros(16_000 * N_FRAMES // 30, np.float32), sample_rate=16_000)
CLIPS = {
    "rig": (rigged(), {}),
    "with speech": (SPOKEN, {}),
    "one frame": (rigged(1), {}),
    "no rig": (changed(rigged(), rig=None), dict.fromkeys(WEIGHTS, NoRigError)),
    "one frame, no rig": (changed(rigged(1), rig=None), dict.fromkeys(WEIGHTS, NoRigError)),
    "two takes": ([rigged(), rigged()], dict.fromkeys(ONE_FACE, OutputSuffixError)),
}


@pytest.mark.parametrize("suffix", writers.FORMATS)
@pytest.mark.parametrize("name", CLIPS)
def test_every_format_with_every_clip(name, suffix, tmp_path):
    clips, refused = CLIPS[name]
    path = tmp_path / f"{ODD}{suffix}"
    if suffix in refused:
        with pytest.raises(refused[suffix], match=rf"^\{suffix} (need|holds one)"):
            writers.save(clips, path)
        assert not list(tmp_path.iterdir())
        return
    writers.save(clips, path)
    first = clips if isinstance(clips, facecode.Clip) else clips[0]
    assert FRAMES[suffix](path) == first.n_frames
    assert list(tmp_path.iterdir()) == [path]
