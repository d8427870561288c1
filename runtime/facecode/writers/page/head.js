// A head out of a .glb: its surface, its shapes, and the weights of each frame. Knows no screen.

class Glb {
  constructor(bytes) {
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const length = view.getUint32(12, true);
    this.tree = JSON.parse(new TextDecoder().decode(bytes.subarray(20, 20 + length)));
    this.binary = bytes.subarray(28 + length, 28 + length + view.getUint32(20 + length, true));
  }

  // The numbers of `count` elements of a buffer view.
  numbers(view, component, count, width) {
    const { byteOffset = 0 } = this.tree.bufferViews[view];
    const kinds = { 5121: Uint8Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array };
    const start = this.binary.byteOffset + byteOffset;
    const copy = this.binary.buffer.slice(start, start + count * width * kinds[component].BYTES_PER_ELEMENT);
    return new kinds[component](copy);
  }

  accessor(index) {
    const { bufferView, componentType, count, type } = this.tree.accessors[index];
    return this.numbers(bufferView, componentType, count, { SCALAR: 1, VEC3: 3, VEC4: 4 }[type]);
  }

  // The vertices that a shape moves, and by how much.
  displacements(index) {
    const { sparse, count } = this.tree.accessors[index];
    if (!sparse) {
      return { at: Uint32Array.from({ length: count }, (_, i) => i), by: this.accessor(index) };
    }
    return {
      at: this.numbers(sparse.indices.bufferView, sparse.indices.componentType, sparse.count, 1),
      by: this.numbers(sparse.values.bufferView, 5126, sparse.count, 3),
    };
  }
}

class Head {
  // The head that node number `index` of a Glb shows.
  constructor(glb, index) {
    const node = glb.tree.nodes[index];
    const mesh = glb.tree.meshes[node.mesh];
    const surface = mesh.primitives[0];
    this.place = node.translation ?? [0, 0, 0];
    this.names = mesh.extras?.targetNames ?? [];
    this.rest = glb.accessor(surface.attributes.POSITION);
    this.triangles = glb.accessor(surface.indices);
    this.shapes = (surface.targets ?? []).map((target) => glb.displacements(target.POSITION));
    this.colours = this.#colours(glb, surface);
    this.positions = this.rest.slice();
    this.normals = new Float32Array(this.rest.length);
    this.show(mesh.weights ?? []);
  }

  #colours(glb, surface) {
    const n = this.rest.length / 3;
    const colours = new Float32Array(3 * n);
    if (surface.attributes.COLOR_0 === undefined) {
      const plain = glb.tree.materials[surface.material].pbrMetallicRoughness.baseColorFactor;
      for (let i = 0; i < 3 * n; i++) colours[i] = plain[i % 3];
      return colours;
    }
    const stored = glb.accessor(surface.attributes.COLOR_0);
    for (let i = 0; i < n; i++) {
      for (let c = 0; c < 3; c++) colours[3 * i + c] = stored[4 * i + c] / 65535;
    }
    return colours;
  }

  // Put `positions` and `normals` to these weights of the shapes.
  show(weights) {
    const { positions, normals, triangles } = this;
    positions.set(this.rest);
    this.shapes.forEach(({ at, by }, k) => {
      const weight = weights[k] ?? 0;
      if (!weight) return;
      for (let i = 0, j = 0; i < at.length; i++) {
        const v = 3 * at[i];
        positions[v] += weight * by[j++];
        positions[v + 1] += weight * by[j++];
        positions[v + 2] += weight * by[j++];
      }
    });
    normals.fill(0);
    for (let t = 0; t < triangles.length; t += 3) {
      const a = 3 * triangles[t], b = 3 * triangles[t + 1], c = 3 * triangles[t + 2];
      const ux = positions[b] - positions[a], uy = positions[b + 1] - positions[a + 1], uz = positions[b + 2] - positions[a + 2];
      const vx = positions[c] - positions[a], vy = positions[c + 1] - positions[a + 1], vz = positions[c + 2] - positions[a + 2];
      const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
      for (const v of [a, b, c]) {
        normals[v] += nx;
        normals[v + 1] += ny;
        normals[v + 2] += nz;
      }
    }
  }
}

class Motion {
  // The weights over time of each node that a Glb animates.
  constructor(glb) {
    const { channels, samplers } = glb.tree.animations[0];
    this.times = glb.accessor(samplers[0].input);
    this.fps = glb.tree.asset.extras.fps;
    this.nodes = channels.map(({ target }) => target.node);
    this.tracks = channels.map(({ sampler }) => glb.accessor(samplers[sampler].output));
  }

  get frames() {
    return this.times.length;
  }

  // The weights of track number `index` at a moment in frames, between two of them if need be.
  weights(index, moment) {
    const track = this.tracks[index], width = track.length / this.frames;
    const first = Math.min(Math.floor(moment), this.frames - 1);
    const next = Math.min(first + 1, this.frames - 1), share = moment - first;
    const found = new Float32Array(width);
    for (let k = 0; k < width; k++) {
      found[k] = track[first * width + k] * (1 - share) + track[next * width + k] * share;
    }
    return found;
  }
}
