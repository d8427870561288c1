// Heads on a canvas: lamps, camera, turning by mouse, finger and keys. Knows no time and no sound.

const VERTEX = `#version 300 es
uniform mat4 camera;
uniform vec3 place;
in vec3 position, normal, colour;
out vec3 n, c, p;
void main() {
  p = position + place;
  n = normal;
  c = colour;
  gl_Position = camera * vec4(p, 1.0);
}`;

// Three lamps and a sky, which turn with the viewer as a photographer's do.
const FRAGMENT = `#version 300 es
precision highp float;
uniform mat3 turn;
uniform vec3 eye;
in vec3 n, c, p;
out vec4 pixel;
void main() {
  vec3 normal = normalize(n);
  vec3 towards = normalize(eye - p);
  vec3 key = turn * normalize(vec3(-0.55, 0.55, 0.75));
  vec3 fill = turn * normalize(vec3(0.85, 0.10, 0.60));
  vec3 rim = turn * normalize(vec3(0.60, 0.45, -0.75));
  vec3 wrap = vec3(0.32, 0.18, 0.12);
  vec3 light = mix(vec3(0.11, 0.095, 0.09), vec3(0.24, 0.25, 0.27), 0.5 + 0.5 * normal.y);
  light += vec3(1.04, 0.965, 0.88) * max((dot(normal, key) + wrap) / (1.0 + wrap), 0.0);
  light += vec3(0.14, 0.16, 0.19) * max((dot(normal, fill) + wrap) / (1.0 + wrap), 0.0);
  light += vec3(0.50, 0.53, 0.58) * max(dot(normal, rim), 0.0);
  float gloss = 0.14 * pow(max(dot(normal, normalize(key + towards)), 0.0), 28.0);
  float sheen = 0.10 * pow(1.0 - max(dot(normal, towards), 0.0), 4.0);
  vec3 linear = c * (light + sheen) + gloss;
  pixel = vec4(mix(12.92 * linear, 1.055 * pow(max(linear, 0.0), vec3(1.0 / 2.4)) - 0.055, step(0.0031308, linear)), 1.0);
}`;

const VIEW_ANGLE = 0.42;

// Drawn samples along a pixel of the page. Smooth edges by finer pixels instead of the browser's multisampling: where
// that is done in software, single samples between two triangles show what lies behind them.
const fineness = (ratio) => Math.max(ratio, Math.min(2 * ratio, 3));

class Viewer {
  // Show heads on a canvas; throws where WebGL 2 is missing.
  constructor(canvas, heads) {
    this.canvas = canvas;
    this.gl = canvas.getContext("webgl2", { antialias: false, alpha: true });
    if (!this.gl) throw new Error("no WebGL 2");
    this.program = this.#program();
    this.heads = heads.map((head) => this.#upload(head));
    this.#measure(heads);
    this.reset();
    this.#listen();
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  #program() {
    const { gl } = this, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    return program;
  }

  #upload(head) {
    const { gl } = this, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const buffer = (name, values, usage) => {
      const made = gl.createBuffer(), at = gl.getAttribLocation(this.program, name);
      gl.bindBuffer(gl.ARRAY_BUFFER, made);
      gl.bufferData(gl.ARRAY_BUFFER, values, usage);
      gl.enableVertexAttribArray(at);
      gl.vertexAttribPointer(at, 3, gl.FLOAT, false, 0, 0);
      return made;
    };
    const positions = buffer("position", head.positions, gl.DYNAMIC_DRAW);
    const normals = buffer("normal", head.normals, gl.DYNAMIC_DRAW);
    buffer("colour", head.colours, gl.STATIC_DRAW);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, Uint32Array.from(head.triangles), gl.STATIC_DRAW);
    return { head, array, positions, normals };
  }

  #measure(heads) {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (const { rest, place } of heads) {
      rest.forEach((value, i) => {
        const axis = i % 3;
        low[axis] = Math.min(low[axis], value + place[axis]);
        high[axis] = Math.max(high[axis], value + place[axis]);
      });
    }
    this.middle = low.map((value, axis) => (value + high[axis]) / 2);
    this.size = low.map((value, axis) => high[axis] - value);
  }

  reset() {
    this.yaw = 0.0;
    this.pitch = 0.05;
    this.nearness = 1;
    this.draw();
  }

  turn(right, up) {
    this.yaw += right;
    this.pitch = Math.max(-1.4, Math.min(1.4, this.pitch + up));
    this.draw();
  }

  zoom(factor) {
    this.nearness = Math.max(0.4, Math.min(6, this.nearness * factor));
    this.draw();
  }

  #listen() {
    const { canvas } = this, fingers = new Map();
    const apart = () => {
      const [a, b] = [...fingers.values()];
      return Math.hypot(a.x - b.x, a.y - b.y);
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const distance = fingers.size === 2 ? apart() : 0;
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      if (fingers.size === 1) this.turn((before.x - event.clientX) / 150, (event.clientY - before.y) / 150);
      else if (distance) this.zoom(apart() / distance);
    });
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
    }
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY / 500));
    }, { passive: false });
    canvas.addEventListener("dblclick", () => this.reset());
    canvas.addEventListener("keydown", (event) => {
      const acts = {
        ArrowLeft: () => this.turn(0.1, 0), ArrowRight: () => this.turn(-0.1, 0),
        ArrowUp: () => this.turn(0, 0.1), ArrowDown: () => this.turn(0, -0.1),
        "+": () => this.zoom(1.15), "=": () => this.zoom(1.15), "-": () => this.zoom(1 / 1.15),
        Home: () => this.reset(),
      };
      if (!acts[event.key]) return;
      event.preventDefault();
      acts[event.key]();
    });
  }

  // Draw on the browser's next frame what the heads show by then.
  draw() {
    this.waiting ??= requestAnimationFrame(() => {
      this.waiting = undefined;
      this.#paint();
    });
  }

  #paint() {
    const { gl, canvas, program } = this, scale = fineness(window.devicePixelRatio || 1);
    const width = Math.max(1, Math.round(canvas.clientWidth * scale));
    const height = Math.max(1, Math.round(canvas.clientHeight * scale));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(program);
    const { camera, turn, eye } = this.#camera(width / height);
    gl.uniformMatrix4fv(gl.getUniformLocation(program, "camera"), false, camera);
    gl.uniformMatrix3fv(gl.getUniformLocation(program, "turn"), false, turn);
    gl.uniform3fv(gl.getUniformLocation(program, "eye"), eye);
    for (const { head, array, positions, normals } of this.heads) {
      gl.bindVertexArray(array);
      gl.bindBuffer(gl.ARRAY_BUFFER, positions);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, head.positions);
      gl.bindBuffer(gl.ARRAY_BUFFER, normals);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, head.normals);
      gl.uniform3fv(gl.getUniformLocation(program, "place"), head.place);
      gl.drawElements(gl.TRIANGLES, head.triangles.length, gl.UNSIGNED_INT, 0);
    }
  }

  #camera(aspect) {
    const [sy, cy, sp, cp] = [Math.sin(this.yaw), Math.cos(this.yaw), Math.sin(this.pitch), Math.cos(this.pitch)];
    const right = [cy, 0, -sy], up = [-sy * sp, cp, -cy * sp], back = [sy * cp, sp, cy * cp];
    const tangent = Math.tan(VIEW_ANGLE / 2);
    const half = Math.max(this.size[1] / 2, this.size[0] / 2 / aspect) * 1.12;
    const distance = (half / tangent + this.size[2] / 2) / this.nearness;
    const eye = this.middle.map((value, axis) => value + distance * back[axis]);
    const near = distance / 50, far = distance + 4 * Math.max(...this.size);
    const dot = (axis) => -(axis[0] * eye[0] + axis[1] * eye[1] + axis[2] * eye[2]);
    const x = 1 / tangent / aspect, y = 1 / tangent;
    const z = (far + near) / (near - far), w = (2 * far * near) / (near - far);
    const columns = [0, 1, 2].map((axis) => [x * right[axis], y * up[axis], z * back[axis], -back[axis]]);
    const last = [x * dot(right), y * dot(up), z * dot(back) + w, -dot(back)];
    return { camera: new Float32Array([...columns.flat(), ...last]), turn: new Float32Array([...right, ...up, ...back]), eye };
  }
}
