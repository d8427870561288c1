// Pictures of a .glb in Chromium with three.js, at times of its last animation; ready to look at.
// node three_picture.mjs NODE_MODULES CHROMIUM FILE OUT.png SECONDS...
// Several times stand side by side. Facts go to stdout as JSON.
import { createReadStream } from 'node:fs';
import { createServer } from 'node:http';
import { createRequire } from 'node:module';
import { extname, join, normalize } from 'node:path';

const [modules, chromium, file, out, ...seconds] = process.argv.slice(2);
const { chromium: browserType } = createRequire(`${modules}/`)('playwright-core');
const SIZE = 400;
const TYPES = { '.js': 'text/javascript', '.wasm': 'application/wasm', '.html': 'text/html' };

const page = `<!doctype html><body style="margin:0;background:#889"><script type="importmap">
{"imports":{"three":"/three/build/three.module.js","three/addons/":"/three/examples/jsm/"}}
</script><script type="module">
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { KTX2Loader } from 'three/addons/loaders/KTX2Loader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
const times = ${JSON.stringify(seconds.map(Number))};
const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
renderer.setSize(${SIZE} * times.length, ${SIZE});
renderer.setScissorTest(true);
document.body.append(renderer.domElement);
const ktx2 = new KTX2Loader().setTranscoderPath('/three/examples/jsm/libs/basis/');
const loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);
loader.setKTX2Loader(ktx2.detectSupport(renderer));
const gltf = await loader.loadAsync('/avatar.glb');
const scene = new THREE.Scene();
scene.background = new THREE.Color(0x99a3ad);
scene.add(gltf.scene, new THREE.HemisphereLight(0xffffff, 0x554433, 1.6));
const key = new THREE.DirectionalLight(0xffffff, 2);
key.position.set(-1, 1, 2);
scene.add(key);
const mixer = new THREE.AnimationMixer(gltf.scene);
const action = mixer.clipAction(gltf.animations.at(-1));
action.setLoop(THREE.LoopOnce);
action.clampWhenFinished = true;
action.play();
const box = new THREE.Box3().setFromObject(gltf.scene);
const [middle, size] = [box.getCenter(new THREE.Vector3()), box.getSize(new THREE.Vector3())];
const camera = new THREE.PerspectiveCamera(25, 1, size.y / 100, size.y * 100);
camera.position.copy(middle).add(new THREE.Vector3(0, 0, Math.max(size.x, size.y) * 2.4 + size.z / 2));
camera.lookAt(middle);
times.forEach((time, index) => {
  mixer.setTime(time);
  renderer.setViewport(index * ${SIZE}, 0, ${SIZE}, ${SIZE});
  renderer.setScissor(index * ${SIZE}, 0, ${SIZE}, ${SIZE});
  renderer.render(scene, camera);
});
window.facts = {
  animations: gltf.animations.map(({ name }) => name),
  duration: gltf.animations.at(-1).duration,
};
</script></body>`;

const server = createServer((request, response) => {
  const path = normalize(new URL(request.url, 'http://localhost').pathname);
  response.setHeader('Content-Type', TYPES[extname(path)] ?? 'application/octet-stream');
  if (path === '/index.html') return response.end(page);
  const stream = createReadStream(path === '/avatar.glb' ? file : join(modules, path));
  return stream.on('error', () => response.writeHead(404).end()).pipe(response);
});
await new Promise((ready) => server.listen(0, '127.0.0.1', ready));
const browser = await browserType.launch({
  executablePath: chromium,
  args: [
    '--no-sandbox',
    '--use-gl=angle',
    '--use-angle=swiftshader',
    '--enable-unsafe-swiftshader',
    '--ignore-gpu-blocklist',
  ],
});
try {
  const tab = await browser.newPage({ viewport: { width: SIZE * seconds.length, height: SIZE } });
  const errors = [];
  tab.on('pageerror', (error) => errors.push(String(error)));
  await tab.goto(`http://127.0.0.1:${server.address().port}/index.html`);
  await tab.waitForFunction('window.facts', null, { timeout: 120_000 }).catch(() => {});
  await tab.screenshot({ path: out });
  const facts = await tab.evaluate('window.facts');
  process.stdout.write(JSON.stringify({ ...facts, errors }));
} finally {
  await browser.close();
  server.close();
}
