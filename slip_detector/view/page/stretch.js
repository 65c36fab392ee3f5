// What traces show: columns of pixels, and the stretch of time of them.

// The arrays that come with each stream of a frame.
const PARTS = {samples: ['low', 'high', 'truth'], levels: ['level', 'slip']};

// Columns of pixels, each with the lowest and the highest value in it. Column k has the stamps
// from k * width up to, but not including, (k + 1) * width.
export class Columns {
  // kept: at least so many columns. begun_s: the stamp of time 0; null: the first column's minute.
  constructor({width_ns: width, channels}, kept, begun_s) {
    Object.assign(this, {width_s: width / 1e9, channels, kept, begun_s});
    // The number of the first column that is kept, and of the one after the last.
    this.base = this.stop = null;
    const each = () => channels.map(() => []);
    this.parts = {low: each(), high: each(), level: each(), slip: [[]], truth: [[]]};
  }

  get last_s() {
    return this.stop === null ? null : this.stop * this.width_s - this.begun_s;
  }

  take(traces, arrays) {
    const came = [traces.samples, traces.levels].filter(({count}) => count);
    if (!came.length) return;
    const stop = Math.max(...came.map(({first, count}) => first + count));
    // After a gap that is longer than what is kept, nothing of before is kept.
    if (this.base === null || stop > this.stop + this.kept) {
      this.base = Math.max(Math.min(...came.map(({first}) => first)), stop - this.kept);
      for (const values of Object.values(this.parts).flat()) values.length = 0;
    }
    this.stop = stop;
    this.begun_s ??= 60 * Math.floor(this.base * this.width_s / 60);
    for (const [stream, parts] of Object.entries(PARTS)) {
      for (const part of parts) this.put(this.parts[part], traces[stream], arrays[part]);
    }
    const old = Math.max(0, this.stop - this.base - this.kept);
    this.base += old;
    for (const values of Object.values(this.parts).flat()) values.splice(0, old);
  }

  // The values of each channel follow one another.
  put(part, {first, count}, from) {
    part.forEach((values, c) => {
      for (let i = Math.max(0, this.base - first); i < count; i++) {
        const value = from[c * count + i];
        values[first - this.base + i] = Number.isFinite(value) ? value : null;
      }
    });
  }

  // The columns between two times: x, their beginnings in seconds, and of each part its values.
  between(from, to) {
    const at = (seconds) => Math.floor((seconds + this.begun_s) / this.width_s) - this.base;
    const first = Math.max(0, at(from));
    const stop = Math.max(first, Math.min(at(to) + 2, this.stop - this.base));
    const secondsOf = (column) => (this.base + column) * this.width_s - this.begun_s;
    const seen = {x: Array.from({length: stop - first}, (_, i) => secondsOf(first + i))};
    for (const [part, each] of Object.entries(this.parts)) {
      seen[part] = each.map((values) => values.slice(first, stop));
    }
    return seen;
  }
}

// The stretch of time that traces show, live or paused, in the seconds of the columns.
const WINDOW_S = {least: 0.5, most: 60, first: 10}, LEAST_S = 0.02;

export class Stretch {
  live = true;
  window_s = WINDOW_S.first;

  goOn(window_s = this.window_s) {
    this.live = true;
    this.window_s = clamp(window_s, WINDOW_S.least, WINDOW_S.most);
  }

  pause() {
    if (this.columns?.last_s == null) return;
    [this.from, this.to] = this.ends();
    this.live = false;
    this.paused_s = this.columns.last_s;
  }

  // Show another interval; how: 'zoom', 'move' or 'whole', as Timeline has it.
  change(from, to, how) {
    if (how === 'whole') this.goOn(WINDOW_S.first);
    else if (how === 'zoom' && this.live) this.goOn(to - from);
    else if (this.live) this.pause();
    if (this.live) return;
    const span = clamp(to - from, LEAST_S, WINDOW_S.most), {paused_s: last} = this;
    // There is nothing after the beginning of the pause, and nothing older than what is kept.
    this.to = clamp((from + to + span) / 2, last - WINDOW_S.most + span, last + 0.05 * span);
    this.from = this.to - span;
    this.window_s = span;
  }

  // The beginning and the end of the stretch; live, the end of the newest column.
  ends() {
    if (!this.live) return [this.from, this.to];
    const to = this.columns?.last_s ?? this.window_s;
    return [to - this.window_s, to];
  }
}
