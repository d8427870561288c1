"""World positions of a mesh that a point cache moves, as Blender shows them: runs where bpy is.

python blender_cache.py MESH.obj CACHE OUT FPS N_FRAMES: OUT gets (N_FRAMES, V, 3) float32 in the
axes of the .obj; facts go to stdout as JSON. Every setting that is not set here is Blender's own.
"""

import json
import sys
import time
from pathlib import Path

import bpy
import numpy as np


def positions(item, graph):
    shown = item.evaluated_get(graph)
    mesh = shown.to_mesh()
    flat = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", flat)
    world = np.array(item.matrix_world, np.float64)
    x, y, z = (flat.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]).T
    shown.to_mesh_clear()
    return np.stack([x, z, -y], axis=1)


mesh_path, cache, out, fps, n_frames = *sys.argv[1:4], float(sys.argv[4]), int(sys.argv[5])
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = round(fps)
bpy.ops.wm.obj_import(filepath=mesh_path)
(item,) = bpy.data.objects
rest = positions(item, bpy.context.evaluated_depsgraph_get())
modifier = item.modifiers.new("talk", "MESH_CACHE")
modifier.cache_format = Path(cache).suffix[1:].upper()
modifier.filepath = cache
modifier.frame_start = 0
begun = time.perf_counter()
frames = []
for frame in range(n_frames):
    scene.frame_set(frame)
    frames.append(positions(item, bpy.context.evaluated_depsgraph_get()))
np.save(out, np.stack([rest, *frames]).astype(np.float32))
facts = {
    "colours": len(item.data.color_attributes),
    "step_s": round(time.perf_counter() - begun, 2),
}
print("\nFACTS " + json.dumps(facts))
