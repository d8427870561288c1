"""What a script does to a head in Blender: runs where bpy is.

python blender_script.py HEAD.glb SCRIPT.py OUT FPS N_FRAMES: imports the head, makes the mesh that
has shape keys the active object, runs the script, and writes to OUT the values of the shape keys
(N_FRAMES, K) and, in glTF's axes, the vertices (N_FRAMES, V, 3). Names of the keys go to stdout as
JSON.
"""

import json
import sys
import time
from pathlib import Path

import bpy
import numpy as np

head, script, out, fps, n_frames = *sys.argv[1:4], float(sys.argv[4]), int(sys.argv[5])
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = round(fps)
bpy.ops.import_scene.gltf(filepath=head)
(item,) = (o for o in bpy.data.objects if o.type == "MESH" and o.data.shape_keys)
bpy.context.view_layer.objects.active = item
begun = time.perf_counter()
exec(compile(Path(script).read_text(), script, "exec"), {"__name__": "__main__"})
keyed = time.perf_counter()
keys = item.data.shape_keys.key_blocks[1:]
values, vertices = [], []
for frame in range(n_frames):
    scene.frame_set(frame)
    values.append([key.value for key in keys])
    shown = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = shown.to_mesh()
    flat = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", flat)
    world = np.array(item.matrix_world, np.float32)
    x, y, z = (flat.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]).T
    vertices.append(np.stack([x, z, -y], axis=1))
    shown.to_mesh_clear()
np.savez(out, values=np.float32(values), vertices=np.float32(vertices))
facts = {"keys": [key.name for key in keys], "script_s": round(keyed - begun, 2)}
print("\nFACTS " + json.dumps(facts))
