"""Heads as .usda, .usdz and .usdc in usd-core and Blender: valid, and every vertex in place."""

import dataclasses
import time

import numpy as np
import pytest
from gltf_clients import bpy_python, far, in_blender, longer, sentence
from small_faces import changed, rigged

from facecode import writers
from facecode.clip import Rig

pytestmark = pytest.mark.clients
pxr = pytest.importorskip("pxr", reason="no usd-core: pip install '.[usd]'")

MEAN_MM, GREATEST_MM, EXACT_MM = 0.02, 0.6, 1e-4
SUFFIXES = (".usda", ".usdz", ".usdc")
ODD = ("jaw open", "jaw_open", 'mouth "wide"', "1ä/b")
SPOKEN = {"audio": np.sin(np.arange(3200, dtype=np.float32)), "sample_rate": 16000}

SMALL = {
    "rig": rigged(),
    "sound": rigged(**SPOKEN),
    "25 fps": rigged(fps=25.0),
    "one frame": rigged(1),
    "one frame, no rig": changed(rigged(1), rig=None),
    "no rig": changed(rigged(40), rig=None),
    "no colours": rigged(colours=None),
    "z up, centimetres": rigged(up_axis="z", metres_per_unit=0.01),
    "takes": [rigged(seed=0), rigged(seed=0), rigged(seed=0)],
    "takes, no rig": [changed(rigged(seed=k), rig=None) for k in range(3)],
    "loose vertices": changed(rigged(), faces=rigged().faces[5:]),
    "odd names": changed(rigged(), rig=Rig(ODD, rigged().rig.deltas)),
}


def findings(path):
    """What the validators of usd-core say, and how many there are."""
    from pxr import Usd, UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(str(path)))
    return len(validators), [f"{each.GetName()}: {each.GetMessage()}" for each in errors]


def in_usd(path, n_frames):
    """Positions (T, V, 3) of all meshes in a row, blend shapes and joints baked by usd-core."""
    from pxr import Gf, Usd, UsdGeom, UsdSkel

    stage = Usd.Stage.Open(str(path))
    session = stage.GetSessionLayer()
    session.timeCodesPerSecond = stage.GetTimeCodesPerSecond()  # else its times are stretched
    stage.SetEditTarget(session)
    UsdSkel.BakeSkinning(stage.Traverse(), Gf.Interval(0, n_frames - 1))
    rows = []
    for mesh in filter(None, map(UsdGeom.Mesh, stage.Traverse())):
        to_world = mesh.ComputeLocalToWorldTransform(0).ExtractTranslation()
        points = [mesh.GetPointsAttr().Get(frame) for frame in range(n_frames)]
        rows.append(np.array(points, np.float32) + np.float32(to_world))
    return np.concatenate(rows, axis=1)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("name", SMALL)
def test_every_kind_of_file_is_valid(tmp_path, name, suffix):
    path = tmp_path / f"talk{suffix}"
    writers.save(SMALL[name], path)
    n_validators, found = findings(path)
    assert n_validators >= 30
    assert found == []


def test_the_validators_find_what_is_wrong(tmp_path):
    path = tmp_path / "wrong.usda"
    writers.save(rigged(), path)
    path.write_text(path.read_text().replace('upAxis = "Y"', ""))
    assert findings(path)[1]


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("name", ["rig", "one frame", "no rig", "odd names"])
def test_points_of_usd_core(tmp_path, name, suffix):
    clip, path = SMALL[name], tmp_path / f"talk{suffix}"
    writers.save(clip, path)
    limit = EXACT_MM if suffix == ".usdc" else 0.1 if clip.rig is None else 2e-3
    assert far(in_usd(path, clip.n_frames), clip.vertices)[1] <= limit


def test_faces_stand_side_by_side(tmp_path):
    clips = SMALL["takes, no rig"]
    writers.save(clips, tmp_path / "talk.usdc")
    shown = in_usd(tmp_path / "talk.usdc", 7)
    centres = shown.reshape(7, 3, -1, 3).mean(axis=(0, 2))
    apart = np.diff(centres[:, 0])
    assert (apart > np.ptp(clips[0].template[:, 0])).all()


def test_times_and_sound(tmp_path):
    from pxr import Usd, UsdGeom, UsdMedia

    writers.save(rigged(fps=25.0, **SPOKEN), tmp_path / "talk.usdz")
    stage = Usd.Stage.Open(str(tmp_path / "talk.usdz"))
    assert stage.GetTimeCodesPerSecond() == 25
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, 6)
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    speech = UsdMedia.SpatialAudio(stage.GetPrimAtPath("/facecode/speech"))
    assert speech.GetAuralModeAttr().Get() == "nonSpatial"
    assert speech.GetFilePathAttr().Get().resolvedPath.endswith("talk.usdz[speech.wav]")


@pytest.mark.parametrize("seconds", [None, 60])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_packaged_sentence(tmp_path, suffix, seconds):
    clip = sentence() if seconds is None else longer(sentence(), seconds)
    path = tmp_path / f"talk{suffix}"
    assert len(clip.weights) == clip.n_frames  # solved before the clock starts
    begun = time.perf_counter()
    writers.save(clip, path)
    took = time.perf_counter() - begun
    assert findings(path)[1] == []
    wanted = clip.vertices
    usd_mm = far(in_usd(path, clip.n_frames), wanted)
    facts = f"\n{suffix} {clip.n_frames} frames: {path.stat().st_size} bytes, {took:.2f} s"
    print(f"{facts}; mean, greatest mm: usd-core {usd_mm}")
    mean, greatest = (EXACT_MM, EXACT_MM) if suffix == ".usdc" else (MEAN_MM, GREATEST_MM)
    assert usd_mm[0] <= mean
    assert usd_mm[1] <= greatest


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_packaged_sentence_in_blender(tmp_path, suffix):
    bpy_python()
    clip, path = sentence(), tmp_path / f"talk{suffix}"
    writers.save(clip, path)
    facts, shown = in_blender(path, clip.fps, clip.n_frames)
    mm = far(shown, clip.vertices)
    print(f"\n{suffix} in Blender: {mm} mm, {facts['import_s']} s, {facts['step_s']} s")
    mean, greatest = (EXACT_MM, EXACT_MM) if suffix == ".usdc" else (MEAN_MM, GREATEST_MM)
    assert mm[0] <= mean
    assert mm[1] <= greatest
    if suffix != ".usdc":
        assert set(facts["keys"][0]) == set(clip.weight_names)
    assert facts["colours"] == [1]


def test_a_head_without_a_rig_in_blender(tmp_path):
    bpy_python()
    clip, path = dataclasses.replace(sentence(), rig=None), tmp_path / "talk.usda"
    writers.save(clip, path)
    _, shown = in_blender(path, clip.fps, clip.n_frames)
    assert far(shown, clip.vertices)[1] <= 0.11
