"""World positions of every vertex as Blender shows them: runs in an environment that has bpy.

python blender_vertices.py FILE OUT FPS N_FRAMES: OUT gets (N_FRAMES, V, 3) float32, the meshes in
the order of their names, in glTF's axes; facts about the import go to stdout as JSON.
"""

import json
import sys
import time

import bpy
import numpy as np


def positions(objects, graph):
    rows = []
    for item in objects:
        shown = item.evaluated_get(graph)
        mesh = shown.to_mesh()
        flat = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", flat)
        world = np.array(item.matrix_world, np.float32)
        rows.append(flat.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3])
        shown.to_mesh_clear()
    x, y, z = np.concatenate(rows).T
    return np.stack([x, z, -y], axis=1)


path, out, fps, n_frames = sys.argv[1], sys.argv[2], float(sys.argv[3]), int(sys.argv[4])
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = round(fps)
begun = time.perf_counter()
if path.endswith(".glb"):
    bpy.ops.import_scene.gltf(filepath=path)
else:
    bpy.ops.wm.usd_import(filepath=path)
imported = time.perf_counter()
objects = sorted((o for o in bpy.data.objects if o.type == "MESH"), key=lambda o: o.name)
frames = []
for frame in range(n_frames):
    scene.frame_set(frame)
    frames.append(positions(objects, bpy.context.evaluated_depsgraph_get()))
stepped = time.perf_counter()
np.save(out, np.stack(frames))
keys = [o.data.shape_keys for o in objects]
facts = {
    "meshes": [o.name for o in objects],
    "keys": [[k.name for k in each.key_blocks][1:] if each else [] for each in keys],
    "colours": [len(o.data.color_attributes) for o in objects],
    "actions": [a.name for a in bpy.data.actions],
    "import_s": round(imported - begun, 2),
    "step_s": round(stepped - imported, 2),
}
print("\nFACTS " + json.dumps(facts))
