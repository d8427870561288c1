"""A .glb to .fbx, and the .fbx back: runs where bpy is.

python blender_fbx.py HEAD.glb OUT.npy FPS N_FRAMES: writes HEAD.fbx beside HEAD.glb as the
documents say, imports it into an empty scene, and writes to OUT the vertices (N_FRAMES, V, 3) in
glTF's axes. Facts go to stdout as JSON.
"""

import json
import sys
import time
from pathlib import Path

import bpy
import numpy as np

head, out, fps, n_frames = Path(sys.argv[1]), sys.argv[2], float(sys.argv[3]), int(sys.argv[4])


def empty_scene():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = round(fps)
    return bpy.context.scene


scene = empty_scene()
bpy.ops.import_scene.gltf(filepath=str(head))
scene.frame_start, scene.frame_end = 0, n_frames - 1
fbx = head.with_suffix(".fbx")
begun = time.perf_counter()
bpy.ops.export_scene.fbx(
    filepath=str(fbx), bake_anim_use_nla_strips=False, bake_anim_use_all_actions=False
)
took = time.perf_counter() - begun
scene = empty_scene()
bpy.ops.import_scene.fbx(filepath=str(fbx), anim_offset=0)
(item,) = (each for each in bpy.data.objects if each.type == "MESH")
frames = []
for frame in range(n_frames):
    scene.frame_set(frame)
    shown = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = shown.to_mesh()
    flat = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", flat)
    world = np.array(item.matrix_world, np.float32)
    x, y, z = (flat.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]).T
    frames.append(np.stack([x, z, -y], axis=1))
    shown.to_mesh_clear()
np.save(out, np.float32(frames))
keys = item.data.shape_keys
facts = {
    "keys": [key.name for key in keys.key_blocks[1:]] if keys else [],
    "bytes": fbx.stat().st_size,
    "export_s": round(took, 2),
}
print("\nFACTS " + json.dumps(facts))
