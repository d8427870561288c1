"""The script of docs/outputs.md in Blender: a .csv keyed onto shape keys gives the clip."""

import re
from pathlib import Path

import numpy as np
import pytest
from gltf_clients import bpy_python, far, in_blender_script, sentence
from small_faces import frames_of, rigged, still

from facecode import writers

pytestmark = pytest.mark.clients

DOCUMENT = Path(__file__).parents[2] / "docs" / "outputs.md"
MEAN_MM, GREATEST_MM = 0.02, 0.6
EXACT = 1e-6


def keyed(clip, still_clip, folder):
    """Facts, values of the shape keys by name, and vertices, after the documents' script ran."""
    bpy_python()
    text = DOCUMENT.read_text().partition("## Keys from a .csv in Blender")[2]
    (code,) = re.findall(r"```python\n(.*?)```", text.partition("\n## ")[0], re.DOTALL)
    assert '"//talk.csv"' in code
    script = code.replace('"//talk.csv"', repr(str(folder / "talk.csv")))
    writers.save(still_clip, folder / "head.glb")
    writers.save(clip, folder / "talk.csv")
    return in_blender_script(folder / "head.glb", script, clip, folder)


def test_the_packaged_sentence(tmp_path):
    clip = sentence()
    facts, values, vertices = keyed(clip, frames_of(clip, slice(0, 0)), tmp_path)
    found = np.stack([values[name] for name in clip.weight_names], axis=1)
    largest, shown_mm = np.abs(found - clip.weights).max(), far(vertices, clip.vertices)
    print(f"\n{facts['script_s']} s; largest error of a weight {largest:.1e}; mm {shown_mm}")
    assert largest <= EXACT
    assert shown_mm[0] <= MEAN_MM
    assert shown_mm[1] <= GREATEST_MM


def test_another_rate(tmp_path):
    clip = rigged(40, fps=25.0)
    _, values, vertices = keyed(clip, still(clip), tmp_path)
    assert np.abs(values["jawOpen"] - clip.weights[:, 1]).max() <= 1e-3  # of a thousandth's round
    assert far(vertices, clip.vertices)[1] <= 0.1
