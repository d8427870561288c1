// Rewrites a .glb without EXT_meshopt_compression and without textures, for readers that lack them.
// node unpack_meshopt.mjs NODE_MODULES IN.glb OUT.glb
import { readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';

const [modules, from, to] = process.argv.slice(2);
const { MeshoptDecoder } = createRequire(`${modules}/`)('meshoptimizer');
await MeshoptDecoder.ready;
const EXTENSION = 'EXT_meshopt_compression';
const file = readFileSync(from);
const length = file.readUInt32LE(12);
const tree = JSON.parse(file.subarray(20, 20 + length));
const binary = file.subarray(28 + length);
const pieces = [];
let end = 0;
for (const view of tree.bufferViews) {
  const packed = view.extensions?.[EXTENSION];
  const start = packed?.byteOffset ?? view.byteOffset ?? 0;
  const bytes = binary.subarray(start, start + (packed?.byteLength ?? view.byteLength));
  let plain = bytes;
  if (packed) {
    plain = new Uint8Array(packed.count * packed.byteStride);
    MeshoptDecoder.decodeGltfBuffer(plain, packed.count, packed.byteStride, bytes, packed.mode, packed.filter);
    delete view.extensions;
  }
  Object.assign(view, { buffer: 0, byteOffset: end, byteLength: plain.length });
  pieces.push(plain, new Uint8Array(-plain.length & 3));
  end += plain.length + (-plain.length & 3);
}
tree.buffers = [{ byteLength: end }];
const gone = [EXTENSION, 'KHR_texture_basisu', 'KHR_texture_transform'];
for (const list of ['extensionsUsed', 'extensionsRequired']) tree[list] = tree[list].filter((name) => !gone.includes(name));
for (const material of tree.materials) delete material.pbrMetallicRoughness.baseColorTexture;
delete tree.textures;
delete tree.images;
const text = Buffer.from(JSON.stringify(tree));
const json = Buffer.concat([text, Buffer.alloc(-text.length & 3, ' ')]);
const chunk = (kind, bytes) => {
  const header = Buffer.alloc(8);
  header.writeUInt32LE(bytes.length, 0);
  header.write(kind, 4, 'latin1');
  return Buffer.concat([header, bytes]);
};
const body = Buffer.concat([chunk('JSON', json), chunk('BIN\0', Buffer.concat(pieces))]);
const head = Buffer.alloc(12);
head.write('glTF');
head.writeUInt32LE(2, 4);
head.writeUInt32LE(12 + body.length, 8);
writeFileSync(to, Buffer.concat([head, body]));
