// What an avatar's expressions weigh under a .vrma, at given times, by three-vrm-animation.
// node vrm_weights.mjs NODE_MODULES FILE SECONDS...
import { readFileSync } from 'node:fs';
import { pathToFileURL } from 'node:url';

const [modules, file, ...seconds] = process.argv.slice(2);
const from = (path) => import(pathToFileURL(`${modules}/${path}`));
globalThis.self = globalThis; // what the loader looks for in a browser
const THREE = await from('three/build/three.module.js');
const { GLTFLoader } = await from('three/examples/jsm/loaders/GLTFLoader.js');
const { VRMExpression, VRMExpressionManager } = await from(
  '@pixiv/three-vrm/lib/three-vrm.module.js',
);
const { VRMAnimationLoaderPlugin, createVRMAnimationExpressionTracks } = await from(
  '@pixiv/three-vrm-animation/lib/three-vrm-animation.module.js',
);

const warnings = [];
console.warn = (...words) => warnings.push(words.join(' '));
const loader = new GLTFLoader();
loader.register((parser) => new VRMAnimationLoaderPlugin(parser));
const bytes = readFileSync(file);
const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
const gltf = await loader.parseAsync(buffer, '');
const [animation] = gltf.userData.vrmAnimations;
const { preset, custom } = animation.expressionTracks;

const root = new THREE.Group();
const manager = new VRMExpressionManager();
for (const name of [...preset.keys(), ...custom.keys()]) {
  const expression = new VRMExpression(name);
  manager.registerExpression(expression);
  root.add(expression);
}
const tracks = createVRMAnimationExpressionTracks(animation, manager);
const clip = new THREE.AnimationClip('talk', animation.duration, [
  ...tracks.preset.values(),
  ...tracks.custom.values(),
]);
const mixer = new THREE.AnimationMixer(root);
const action = mixer.clipAction(clip);
action.setLoop(THREE.LoopOnce);
action.clampWhenFinished = true;
action.play();

const weights = Object.fromEntries(root.children.map(({ expressionName }) => [expressionName, []]));
for (const time of seconds) {
  mixer.setTime(Number(time));
  for (const { expressionName, weight } of root.children) weights[expressionName].push(weight);
}
process.stdout.write(
  JSON.stringify({
    animations: gltf.userData.vrmAnimations.length,
    duration: animation.duration,
    presets: [...preset.keys()],
    custom: [...custom.keys()],
    warnings,
    weights,
  }),
);
