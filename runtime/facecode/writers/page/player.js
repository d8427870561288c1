// The page: what was embedded, the clock, the sound in step with it, and the buttons.

const bytesOf = (id) => Uint8Array.from(atob(document.getElementById(id).textContent), (c) => c.charCodeAt(0));
const part = (id) => document.getElementById(id);

class Clock {
  // Seconds of the clip; with `sound`, those that are heard.
  constructor(duration, sound) {
    Object.assign(this, { duration, sound, start: 0, since: null });
  }

  get playing() {
    return this.since !== null;
  }

  #tick() {
    return this.context ? this.context.currentTime - (this.context.outputLatency || 0) : performance.now() / 1000;
  }

  get now() {
    const passed = this.playing ? Math.max(0, this.#tick() - this.since) : 0;
    return Math.min(this.start + passed, this.duration);
  }

  async play() {
    if (this.start >= this.duration) this.start = 0;
    if (this.sound.length) {
      this.context ??= new AudioContext();
      this.samples ??= await this.context.decodeAudioData(this.sound.slice().buffer);
      await this.context.resume();
      this.source = this.context.createBufferSource();
      this.source.buffer = this.samples;
      this.source.connect(this.context.destination);
      this.source.start(0, Math.min(this.start, this.samples.duration));
    }
    this.since = this.#tick() + (this.context?.outputLatency || 0);
  }

  pause() {
    this.start = this.now;
    this.since = null;
    this.source?.stop();
    this.source = undefined;
  }

  async seek(seconds) {
    const playing = this.playing;
    if (playing) this.pause();
    this.start = Math.max(0, Math.min(seconds, this.duration));
    if (playing) await this.play();
  }
}

function trouble(text) {
  part("trouble").textContent = text;
  part("trouble").hidden = false;
  part("view").hidden = true;
}

function begin() {
  const bytes = bytesOf("head"), glb = new Glb(bytes), motion = new Motion(glb);
  const heads = motion.nodes.map((node) => new Head(glb, node));
  const clock = new Clock(motion.frames / motion.fps, bytesOf("speech"));
  const seek = part("seek"), play = part("play");
  seek.max = motion.frames - 1;
  let viewer = null;
  const show = (moment) => {
    heads.forEach((head, i) => head.show(motion.weights(i, moment)));
    viewer?.draw();
  };
  const refresh = () => {
    const moment = Math.min(clock.now * motion.fps, motion.frames - 1);
    show(moment);
    seek.value = moment;
    part("clock").textContent = `${clock.now.toFixed(1)} s`;
    if (clock.playing && clock.now >= clock.duration) clock.pause();
    play.setAttribute("aria-pressed", clock.playing);
    play.setAttribute("aria-label", clock.playing ? "Pause" : "Play");
    if (clock.playing) requestAnimationFrame(refresh);
  };
  const toggle = async () => {
    try {
      if (clock.playing) clock.pause();
      else await clock.play();
    } catch (error) {
      trouble(`This browser cannot play the sound: ${error.message}`);
    }
    refresh();
  };
  play.addEventListener("click", toggle);
  seek.addEventListener("input", () => clock.seek(seek.value / motion.fps).then(refresh));
  document.addEventListener("keydown", (event) => {
    if (event.key !== " " || event.target.tagName === "BUTTON") return;
    event.preventDefault();
    toggle();
  });
  part("save").addEventListener("click", () => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([bytes], { type: "model/gltf-binary" }));
    link.download = "facecode.glb";
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  });
  try {
    viewer = new Viewer(part("view"), heads);
  } catch {
    trouble("This browser shows no 3D graphics (WebGL 2). Save the .glb and open it in Blender or another viewer.");
  }
  refresh();
  window.facecode = {
    frames: motion.frames,
    get moment() { return clock.now * motion.fps; },
    positions(face, moment) {
      heads[face].show(motion.weights(face, moment));
      return Array.from(heads[face].positions);
    },
  };
}

begin();
