// The page: buttons, the head, and what is going on.

const part = (id) => document.getElementById(id);
const RETRY_S = [0.5, 1, 2, 4];
const AHEAD_S = 0.4;

const say = (text) => {
  part("status").textContent = text;
};

function trouble(text) {
  part("trouble").textContent = text;
  part("trouble").hidden = false;
  part("view").hidden = true;
}

class Page {
  static IDLE = "Press Speak, or drop an audio file";

  constructor(face, head, viewer) {
    Object.assign(this, { face, head, viewer, tries: 0, skipped: 0, frames: 0, source: null, connection: null });
    this.playout = new Playout(face.fps);
    this.lag = new Lag();
    say(Page.IDLE);
  }

  get live() {
    return this.source instanceof Microphone;
  }

  async speak() {
    this.stop();
    say("Waiting for the microphone…");
    this.source = await Microphone.open((samples) => this.#heard(samples));
    this.source.onlost(() => this.stop("The microphone is gone."));
    this.#connect();
  }

  async play(bytes) {
    this.stop();
    say("Reading…");
    this.source = await Recording.open(bytes);
    this.#connect();
  }

  stop(text = Page.IDLE) {
    clearTimeout(this.retry);
    this.connection?.close();
    this.source?.close();
    Object.assign(this, { source: null, connection: null, tries: 0 });
    this.#button();
    say(text);
  }

  restyle(style) {
    this.connection?.order("style", { style });
  }

  async show(identity) {
    const path = identity ? `head.glb?identity=${encodeURIComponent(identity)}` : "head.glb";
    const other = new Head(new Glb(new Uint8Array(await (await fetched(path)).arrayBuffer())), 0);
    this.head.rest.set(other.rest);
    this.#draw();
  }

  #connect() {
    this.#button();
    const { source } = this;
    this.playout = new Playout(this.face.fps);
    this.lag = new Lag();
    this.skipped = 0;
    const opening = { sample_rate: source.rate, style: part("style").value, live: this.live, rest_in_quiet: this.live };
    this.connection = new Connection(opening, {
      ready: (message) => this.#ready(message),
      frames: (frames) => this.#frames(frames),
      told: (message) => this.#told(message),
      closed: (reason, text) => this.#closed(reason, text),
    });
    requestAnimationFrame(() => this.#tick());
  }

  #ready({ latency_ms }) {
    this.tries = 0;
    this.planned = latency_ms / 1000;
    if (this.live) say("Listening");
    else this.#send();
  }

  // Send a recording, no faster than the server takes it.
  async #send() {
    const { connection, source } = this;
    say("Listening to the file…");
    for (const samples of source.pieces()) {
      while (connection.waiting > 4 * samples.byteLength) await new Promise((go) => setTimeout(go, 10));
      if (!connection.ready) return;
      connection.speak(samples);
    }
    connection.order("finish");
  }

  #heard(samples) {
    const loudness = Math.sqrt(samples.reduce((sum, each) => sum + each * each, 0) / samples.length) / 32768;
    part("speak").style.setProperty("--level", Math.min(1, 4 * loudness).toFixed(2));
    if (!this.connection?.ready) return;
    this.connection.speak(samples);
    this.lag.spoke(samples.length / this.source.rate, now());
  }

  #frames(frames) {
    this.playout.add(frames);
    this.frames += frames.length;
    if (this.live) {
      this.lag.came(frames[0].time, now());
      this.#measure();
    } else if (this.source.start === null && this.playout.end >= AHEAD_S) this.#hear();
  }

  #hear() {
    if (this.source.start !== null) return;
    say("");
    this.source.play();
  }

  #told({ type, skipped, frames }) {
    if (type === "skipped") this.skipped = frames;
    if (type === "finish_done" && !this.live) this.#hear();
  }

  #closed(reason, text) {
    this.connection = null;
    if (reason === "finished") return;
    if (!this.live || !["lost", "busy", "too_long"].includes(reason)) return this.stop(text || "The server is gone.");
    const seconds = RETRY_S[Math.min(this.tries++, RETRY_S.length - 1)];
    say({ lost: "The server is gone; trying again…", busy: "All places are taken; waiting for one…" }[reason] ?? "Beginning anew…");
    this.retry = setTimeout(() => this.#connect(), 1000 * seconds);
  }

  #tick() {
    if (!this.source) return this.#rest();
    const moment = this.live ? this.lag.moment(now()) : this.source.moment;
    if (!this.live && !this.connection && moment > this.playout.end + 0.5) return this.stop();
    if (this.live) this.playout.forgetBefore(moment - 1);
    this.weights = this.playout.weights(moment);
    this.#draw();
    this.waiting ??= requestAnimationFrame(() => {
      this.waiting = undefined;
      this.#tick();
    });
  }

  #rest() {
    this.weights = [];
    this.#draw();
  }

  #draw() {
    this.head.show(this.weights ?? []);
    this.viewer?.draw();
  }

  #button() {
    const on = this.source !== null;
    part("speak").setAttribute("aria-pressed", on);
    part("speak").querySelector("span").textContent = on ? "Stop" : "Speak";
    part("speak").style.setProperty("--level", 0);
    part("meter").hidden = !this.live;
  }

  #measure() {
    const { delays, shown } = this.lag, ms = (seconds) => Math.round(1000 * seconds);
    const top = Math.max(2 * this.planned, ...delays);
    const height = (seconds) => (36 - (36 * seconds) / top).toFixed(1);
    part("latency").textContent = ms(shown);
    part("history").setAttribute("points", delays.map((delay, i) => `${i},${height(delay)}`).join(" "));
    part("planned").setAttribute("d", `M0 ${height(this.planned)}H120`);
    const left_out = this.skipped ? `; ${this.skipped} frames left out` : "";
    part("details").textContent = `by design ${ms(this.planned)}, half within ${ms(this.lag.percentile(0.5))}, 95 % within ${ms(this.lag.percentile(0.95))}${left_out}`;
  }
}

async function begin() {
  const face = await (await fetched("face.json")).json();
  const head = new Head(new Glb(new Uint8Array(await (await fetched("head.glb")).arrayBuffer())), 0);
  let viewer = null;
  try {
    viewer = new Viewer(part("view"), [head]);
  } catch {
    trouble("This browser shows no 3D graphics (WebGL 2).");
  }
  const page = new Page(face, head, viewer);
  part("style").append(...face.styles.map((name) => new Option(name)));
  part("identity").append(new Option("default", ""), ...face.identities.map((name) => new Option(name)));
  part("identity").parentElement.hidden = !face.identities.length;
  const guarded = (act) => async (event) => {
    try {
      await act(event);
    } catch (error) {
      page.stop(error.name === "NotAllowedError" ? "The browser gives this page no microphone." : error.message);
    }
  };
  part("speak").addEventListener("click", guarded(() => (page.source ? page.stop() : page.speak())));
  part("sample").addEventListener("click", guarded(async () => page.play(await (await fetched("speech.flac")).arrayBuffer())));
  part("file").addEventListener("change", guarded(async ({ target }) => {
    const [file] = target.files;
    target.value = "";
    if (file) await page.play(await file.arrayBuffer());
  }));
  part("style").addEventListener("change", ({ target }) => page.restyle(target.value));
  part("identity").addEventListener("change", guarded(({ target }) => page.show(target.value)));
  listenForFiles(guarded((file) => file.arrayBuffer().then((bytes) => page.play(bytes))));
  window.facecode = page;
}

function listenForFiles(play) {
  const shown = (on) => (event) => {
    event.preventDefault();
    part("drop").hidden = !on;
  };
  document.addEventListener("dragover", shown(true));
  document.addEventListener("dragleave", shown(false));
  document.addEventListener("drop", (event) => {
    shown(false)(event);
    const [file] = event.dataTransfer.files;
    if (file) play(file);
  });
}

begin().catch((error) => trouble(`The server does not answer: ${error.message}`));
