"""Point caches on the mesh of `facecode mesh` in Blender: every vertex of every frame in place."""

import dataclasses
import time

import numpy as np
import pytest
from gltf_clients import bpy_python, far, in_blender_cache, longer, sentence
from small_faces import changed, frames_of, rigged, still

from facecode import writers
from facecode.writers.mesh import save_mesh
from facecode.writers.space import metres_y_up

pytestmark = pytest.mark.clients

EXACT_MM = 1e-4
SUFFIXES = (".pc2", ".mdd")


def shown(clip, folder, suffix):
    """Facts, the mesh at rest (V, 3) and all frames (T, V, 3), as Blender shows them."""
    mesh, cache = folder / "neutral.obj", folder / f"talk{suffix}"
    at_rest = dataclasses.replace(clip, offsets=clip.offsets[:0], codes=clip.codes[:0])
    save_mesh(at_rest, mesh)
    begun = time.perf_counter()
    writers.save(clip, cache)
    took = time.perf_counter() - begun
    facts, found = in_blender_cache(mesh, cache, clip.fps, clip.n_frames)
    return facts | {"write_s": took, "bytes": cache.stat().st_size}, found[0], found[1:]


@pytest.mark.parametrize("seconds", [None, 60])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_packaged_sentence(tmp_path, suffix, seconds):
    bpy_python()
    clip = sentence() if seconds is None else longer(sentence(), seconds)
    facts, rest, frames = shown(clip, tmp_path, suffix)
    mean, largest = far(frames, clip.vertices)
    print(f"\n{suffix}, {clip.n_frames} frames: {facts}; mean, largest mm {mean:.2e} {largest:.2e}")
    assert largest <= EXACT_MM
    assert far(rest[None], clip.template[None])[1] <= EXACT_MM
    assert facts["colours"] == 1


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("n_frames", [1, 7])
def test_another_unit_axis_and_rate(tmp_path, suffix, n_frames):
    """Metres and y up, for the mesh as for its cache; no units, no colours."""
    clip = frames_of(rigged(7, fps=25.0, scale=10.0), slice(0, n_frames))
    clip = changed(clip, metres_per_unit=0.01, up_axis="z", rig=None, colours=None)
    _, rest, frames = shown(clip, tmp_path, suffix)
    assert far(frames, metres_y_up(clip, clip.vertices))[1] <= EXACT_MM
    assert far(rest[None], metres_y_up(clip, clip.template)[None])[1] <= EXACT_MM


def test_a_mesh_of_another_count_is_not_moved(tmp_path):
    """What a user sees who takes the wrong mesh; and the other tests do compare something."""
    clip = rigged(3)
    half = changed(still(clip), template=clip.template[:20], faces=np.int32([[0, 1, 2]]))
    save_mesh(changed(half, colours=None), tmp_path / "half.obj")
    writers.save(clip, tmp_path / "talk.pc2")
    _, found = in_blender_cache(tmp_path / "half.obj", tmp_path / "talk.pc2", 30, 3)
    assert np.array_equal(found[0], found[2])
