// Where speech comes from: a microphone, or a recording.

class Microphone {
  // Ask for the microphone; `take` gets Int16Array pieces of 20 ms, at `rate` Hz.
  static async open(take) {
    if (!navigator.mediaDevices) {
      throw new Error("Browsers give the microphone to pages of https:// or of this machine alone. A file works everywhere.");
    }
    const stream = await navigator.mediaDevices.getUserMedia({ audio: { channelCount: 1 } });
    const context = new AudioContext({ latencyHint: "interactive" });
    await context.audioWorklet.addModule("capture.js");
    const capture = new AudioWorkletNode(context, "capture", { numberOfOutputs: 0, channelCount: 1, channelCountMode: "explicit" });
    capture.port.onmessage = ({ data }) => take(data);
    context.createMediaStreamSource(stream).connect(capture);
    await context.resume();
    return new Microphone(stream, context);
  }

  constructor(stream, context) {
    Object.assign(this, { stream, context, rate: context.sampleRate });
  }

  onlost(act) {
    this.stream.getAudioTracks()[0].onended = act;
  }

  close() {
    this.stream.getTracks().forEach((track) => track.stop());
    this.context.close();
  }
}

class Recording {
  // Decode the bytes of an audio file.
  static async open(bytes) {
    const context = new AudioContext();
    try {
      return new Recording(context, await context.decodeAudioData(bytes));
    } catch {
      context.close();
      throw new Error("The browser cannot read this as audio.");
    }
  }

  constructor(context, sound) {
    Object.assign(this, { context, sound, rate: sound.sampleRate, start: null });
  }

  // The speech as pieces of a quarter of a second.
  *pieces() {
    const { sound } = this, length = Math.ceil(sound.sampleRate / 4);
    const channels = Array.from({ length: sound.numberOfChannels }, (_, i) => sound.getChannelData(i));
    for (let from = 0; from < sound.length; from += length) {
      yield Int16Array.from({ length: Math.min(length, sound.length - from) }, (_, i) => {
        const sum = channels.reduce((total, channel) => total + channel[from + i], 0);
        return Math.max(-1, Math.min(1, sum / channels.length)) * 32767;
      });
    }
  }

  async play() {
    await this.context.resume();
    this.node = new AudioBufferSourceNode(this.context, { buffer: this.sound });
    this.node.connect(this.context.destination);
    this.start = this.context.currentTime + 0.02;
    this.node.start(this.start);
  }

  // The moment that is heard, in seconds.
  get moment() {
    return this.start === null ? 0 : this.context.currentTime - this.start - (this.context.outputLatency || 0);
  }

  close() {
    this.node?.stop();
    this.context.close();
  }
}
