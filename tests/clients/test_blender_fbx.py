"""FBX by way of Blender, as docs/outputs.md says it: names, and every vertex of every frame."""

import json

import numpy as np
import pytest
from gltf_clients import HERE, bpy_python, far, run, sentence

from facecode import writers

pytestmark = pytest.mark.clients

MEAN_MM, GREATEST_MM = 0.02, 0.6


def test_the_packaged_sentence(tmp_path):
    python, clip = bpy_python(), sentence()
    head, out = tmp_path / "talk.glb", tmp_path / "out.npy"
    writers.save(clip, head)
    printed = run(python, HERE / "blender_fbx.py", head, out, clip.fps, clip.n_frames)
    line = next(line for line in printed.splitlines() if line.startswith("FACTS "))
    facts = json.loads(line.removeprefix("FACTS "))
    shown_mm = far(np.load(out), clip.vertices)
    print(f"\n{facts['bytes']} bytes, {facts['export_s']} s; mm {shown_mm}")
    assert facts["keys"] == list(clip.weight_names)
    assert shown_mm[0] <= MEAN_MM
    assert shown_mm[1] <= GREATEST_MM
