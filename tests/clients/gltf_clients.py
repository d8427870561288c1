"""Programs of other people that open our files, and the clips that they are given."""

import dataclasses
import functools
import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import SPEECH

import facecode
from facecode.clip import Rig
from facecode_exporter.head.face_units import FACE_UNITS
from facecode_exporter.head.head import load_head

HERE = Path(__file__).parent
TIMEOUT_S = 300


def node_modules():
    """The folder with what package.json lists."""
    found = Path(os.environ.get("FACECODE_NODE_MODULES", HERE / "node_modules"))
    if not (found / "three").is_dir():
        pytest.skip(f"no packages of Node.js in {found}: npm install --prefix {HERE}")
    return found


def bpy_python():
    """A Python that has bpy, Blender as a module."""
    found = os.environ.get("FACECODE_BPY_PYTHON")
    if not found:
        pytest.skip("no Blender: FACECODE_BPY_PYTHON names a Python with bpy installed")
    return found


def chromium():
    """A browser."""
    found = shutil.which("chromium")
    return found or pytest.skip("no Chromium: apt-get install chromium")


def openfacefx():
    """The folder of a package that reads and writes tracks of face animation."""
    spec = importlib.util.find_spec("openfacefx")
    folder = os.environ.get(
        "FACECODE_OPENFACEFX", spec.submodule_search_locations[0] if spec else ""
    )
    if not folder or not Path(folder).is_dir():
        pytest.skip(
            "no OpenFaceFX: pip install openfacefx, or FACECODE_OPENFACEFX names its folder"
        )
    return Path(folder).resolve()


def facecap():
    """A head of others with ARKit's shapes, compressed by meshopt."""
    path = openfacefx() / "studio_web" / "assets" / "facecap.glb"
    return path if path.is_file() else pytest.skip(f"no {path}")


def run(*command):
    """What a client prints."""
    ran = subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, timeout=TIMEOUT_S
    )
    assert ran.returncode == 0, ran.stdout[-2000:] + ran.stderr[-2000:]
    return ran.stdout


def validated(*files):
    """The findings of Khronos' validator on each file."""
    reports = json.loads(run("node", HERE / "validate_gltf.mjs", node_modules(), *files))
    assert all(not report["truncated"] and report["info"] for report in reports)
    return reports


def in_three(path, seconds):
    """Facts, and positions (n, V, 3) of all meshes in a row, as three.js shows them."""
    out = path.with_suffix(".three")
    facts = json.loads(
        run("node", HERE / "three_vertices.mjs", node_modules(), path, out, *seconds)
    )
    return facts, np.fromfile(out, "<f4").reshape(len(seconds), -1, 3)


def in_blender(path, fps, n_frames):
    """Facts, and positions (T, V, 3) of all meshes in a row, as Blender shows them."""
    out = path.with_suffix(".npy")
    printed = run(bpy_python(), HERE / "blender_vertices.py", path, out, fps, n_frames)
    facts = next(line for line in printed.splitlines() if line.startswith("FACTS "))
    return json.loads(facts.removeprefix("FACTS ")), np.load(out)


def in_blender_cache(mesh, cache, fps, n_frames):
    """Facts, and positions (T, V, 3) of a mesh under a Mesh Cache modifier, as Blender shows."""
    out = cache.with_suffix(".npy")
    script = HERE / "blender_cache.py"
    printed = run(bpy_python(), script, mesh, cache, out, fps, n_frames)
    facts = next(line for line in printed.splitlines() if line.startswith("FACTS "))
    return json.loads(facts.removeprefix("FACTS ")), np.load(out)


def in_blender_script(head, script, clip, out):
    """Facts, values of the shape keys by name (T,), and vertices (T, V, 3), after a script."""
    (out / "script.py").write_text(script)
    words = (HERE / "blender_script.py", head, out / "script.py", out / "shown.npz")
    printed = run(bpy_python(), *words, clip.fps, len(clip.weights))
    facts = next(line for line in printed.splitlines() if line.startswith("FACTS "))
    facts = json.loads(facts.removeprefix("FACTS "))
    with np.load(out / "shown.npz") as arrays:
        values = dict(zip(facts["keys"], arrays["values"].T, strict=True))
        return facts, values, arrays["vertices"]


def in_openfacefx(path):
    """For each channel its keys (n, 2): time in seconds, value."""
    found = json.loads(run(sys.executable, HERE / "openfacefx_tracks.py", openfacefx(), path))
    return {name: np.array(keys) for name, keys in found.items()}


def in_three_vrm(path, times):
    """Facts, and a dict of expression to weights (n,) that an avatar of three-vrm takes."""
    out = json.loads(run("node", HERE / "vrm_weights.mjs", node_modules(), path, *times))
    return out, {name: np.array(values) for name, values in out.pop("weights").items()}


def in_chromium(path, out, *seconds):
    """Facts, and a picture in `out`, as three.js draws the last animation at these times."""
    script = HERE / "three_picture.mjs"
    return json.loads(run("node", script, node_modules(), chromium(), path, out, *seconds))


def far(found, wanted):
    """Mean and greatest distance in mm."""
    distance = np.linalg.norm(found - wanted, axis=2) * 1000
    return float(distance.mean()), float(distance.max())


@functools.cache
def sentence():
    """The packaged sentence on the packaged head, with the head's units."""
    clip = facecode.load(threads=1).animate(SPEECH)
    return dataclasses.replace(clip, rig=Rig(FACE_UNITS, load_head().unit_offsets))


def longer(clip, seconds):
    """The clip over and over."""
    frames = np.arange(round(seconds * clip.fps)) % clip.n_frames
    return dataclasses.replace(clip, offsets=clip.offsets[frames], codes=clip.codes[frames])
