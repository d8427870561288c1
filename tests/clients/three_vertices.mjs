// World positions of every vertex as three.js shows them, at given times of the first animation.
// node three_vertices.mjs NODE_MODULES FILE OUT SECONDS...
// OUT: float32, for each time, for each mesh in the order of the JSON on stdout, (V, 3).
import { readFileSync, writeFileSync } from 'node:fs';
import { pathToFileURL } from 'node:url';

const [modules, file, out, ...seconds] = process.argv.slice(2);
const from = (path) => import(pathToFileURL(`${modules}/${path}`));
globalThis.self = globalThis; // what the loader looks for in a browser
const THREE = await from('three/build/three.module.js');
const { GLTFLoader } = await from('three/examples/jsm/loaders/GLTFLoader.js');

const begun = performance.now();
const bytes = readFileSync(file);
const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
const gltf = await new GLTFLoader().parseAsync(buffer, '');
const meshes = [];
gltf.scene.traverse((node) => node.isMesh && meshes.push(node));
const mixer = new THREE.AnimationMixer(gltf.scene);
const action = mixer.clipAction(gltf.animations[0]);
action.setLoop(THREE.LoopOnce);
action.clampWhenFinished = true;
action.play();

const values = [];
const place = new THREE.Vector3();
for (const time of seconds) {
  mixer.setTime(Number(time));
  gltf.scene.updateMatrixWorld(true);
  for (const mesh of meshes) {
    for (let i = 0; i < mesh.geometry.attributes.position.count; i++) {
      mesh.getVertexPosition(i, place).applyMatrix4(mesh.matrixWorld);
      values.push(place.x, place.y, place.z);
    }
  }
}
writeFileSync(out, Float32Array.from(values));
const about = meshes.map((mesh) => ({
  name: mesh.name,
  vertices: mesh.geometry.attributes.position.count,
  targets: Object.keys(mesh.morphTargetDictionary ?? {}),
  colours: 'color' in mesh.geometry.attributes,
}));
const clip = gltf.animations[0];
process.stdout.write(
  JSON.stringify({
    meshes: about,
    duration: clip.duration,
    animations: gltf.animations.map(({ name }) => name),
    ms: Math.round(performance.now() - begun),
  }),
);
