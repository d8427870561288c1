// A session of the server, as docs/serve.md describes it: speech up, frames down.

// Times of the page in seconds.
const now = () => performance.now() / 1000;

// What the server asks for, if it asks: the page was opened with #token=...
const TOKEN = new URLSearchParams(location.hash.slice(1)).get("token") ?? "";

const fetched = async (path) => {
  const answer = await fetch(path, { headers: TOKEN ? { Authorization: `Bearer ${TOKEN}` } : {} });
  if (!answer.ok) throw new Error((await answer.text()).trim());
  return answer;
};

class Connection {
  // `heard` takes { ready(message), frames(list), told(message), closed(reason, text) }.
  constructor(opening, heard) {
    const url = new URL("stream", location.href);
    url.protocol = url.protocol.replace("http", "ws");
    url.hash = url.search = "";
    this.socket = new WebSocket(url);
    this.socket.binaryType = "arraybuffer";
    this.ready = false;
    this.socket.onopen = () => this.socket.send(JSON.stringify(TOKEN ? { ...opening, token: TOKEN } : opening));
    this.socket.onmessage = ({ data }) => {
      if (typeof data !== "string") return heard.frames(this.#unpack(data));
      const message = JSON.parse(data);
      if (message.type === "ready") {
        this.words = 2 + message.weight_names.length;
        this.ready = true;
        heard.ready(message);
      } else if (message.type === "end") this.end = message;
      else heard.told(message);
    };
    this.socket.onclose = ({ code }) => {
      this.ready = false;
      heard.closed(this.end?.reason ?? (code === 1000 ? "finished" : "lost"), this.end?.message ?? "");
    };
  }

  #unpack(data) {
    const numbers = new Float32Array(data), whole = new Uint32Array(data), frames = [];
    for (let at = 0; at < numbers.length; at += this.words) {
      frames.push({ index: whole[at], time: numbers[at + 1], weights: numbers.subarray(at + 2, at + this.words) });
    }
    return frames;
  }

  // Speech as Int16Array, which browsers hold in the byte order of the protocol.
  speak(samples) {
    if (this.ready) this.socket.send(samples);
  }

  order(type, fields = {}) {
    if (this.ready) this.socket.send(JSON.stringify({ type, ...fields }));
  }

  get waiting() {
    return this.socket.bufferedAmount;
  }

  close() {
    this.socket.onclose = this.socket.onmessage = null;
    this.socket.close();
  }
}
