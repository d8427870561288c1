// Which face to show when: frames by their time in the speech, and how late they come.

class Playout {
  constructor(fps) {
    Object.assign(this, { fps, frames: [] });
  }

  add(frames) {
    this.frames.push(...frames);
  }

  forgetBefore(moment) {
    while (this.frames.length > 2 && this.frames[1].time < moment) this.frames.shift();
  }

  get end() {
    return this.frames.length ? this.frames.at(-1).time + 1 / this.fps : 0;
  }

  // The weights at a moment of the speech in seconds, between two frames if need be; frames that
  // were skipped are bridged, and after the last one the face comes to rest.
  weights(moment) {
    const { frames } = this;
    if (!frames.length) return [];
    let low = 0, high = frames.length;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (frames[middle].time <= moment) low = middle;
      else high = middle;
    }
    const a = frames[low], b = frames[low + 1];
    if (!b) {
      const rest = Math.max(0, Math.min(1, (moment - a.time - 0.15) / 0.3));
      return a.weights.map((weight) => weight * (1 - rest));
    }
    const share = Math.max(0, Math.min(1, (moment - a.time) / (b.time - a.time)));
    return a.weights.map((weight, k) => weight * (1 - share) + b.weights[k] * share);
  }
}

// When each second of the speech was spoken, and how long after that its face was there. Times in seconds.
class Lag {
  constructor() {
    Object.assign(this, { sent: 0, origin: Infinity, delays: [], shown: 0 });
  }

  // `seconds` more of the speech left the microphone by `now`.
  spoke(seconds, now) {
    this.sent += seconds;
    // The clocks of sound and page differ by up to 200 millionths.
    this.origin = Math.min(this.origin + 2e-4 * seconds, now - this.sent);
  }

  // A message with the frame of `time` came `now`.
  came(time, now) {
    const delay = now - this.origin - time;
    this.delays.push(delay);
    if (this.delays.length > 120) this.delays.shift();
    // Show every frame as late as the latest of late, so that none is shown before it is there.
    this.shown = Math.max(delay + 0.005, this.shown - 0.001);
  }

  // The moment of the speech to show `now`.
  moment(now) {
    return now - this.origin - this.shown;
  }

  percentile(share) {
    const sorted = [...this.delays].sort((a, b) => a - b);
    return sorted.length ? sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] : NaN;
  }
}
