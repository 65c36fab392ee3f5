// What traces show: columns of pixels, and the stretch of time of them.

// The data of traces: columns of pixels, each with the lowest and the highest value in it. Column k
// has the stamps from k * width up to, but not including, (k + 1) * width, so that its content does not
// change while the page scrolls.
// Values more than so many sample periods apart are not joined by a line.
const JOINED_PERIODS = 3;

export class Columns {
  // kept: how many columns are kept at least. begun_s: the stamp at which times are 0; null: the
  // whole minute before the first column, so that ticks are those of a clock.
  constructor({width_ns: width, channels}, kept, period_s, begun_s) {
    this.width_s = width / 1e9;
    this.kept = kept;
    this.most = Math.max(1, Math.ceil(JOINED_PERIODS * period_s / this.width_s));
    this.channels = channels;
    this.last_s = null;
    this.begun_s = begun_s;
    this.clear();
  }

  clear() {
    this.base = null;
    this.x = [];
    const curves = () => this.channels.map(() => []);
    this.curves = {low: curves(), high: curves(), level: curves()};
    this.bits = {slip: [], truth: []};
    // By curve, the last column with a value, counted from base.
    this.before = new Map();
    this.stop = {samples: 0, levels: 0};
  }

  // Take a frame's traces and their arrays.
  take({samples, levels}, arrays) {
    const came = Object.entries({samples, levels}).filter(([, {count}]) => count);
    const stop = Math.max(...came.map(([, {first, count}]) => first + count));
    // Start over after a long gap, in which the page was hidden or no samples came.
    if (this.base !== null && stop > this.base + this.x.length + this.kept) this.clear();
    if (came.length) this.base ??= Math.max(Math.min(...came.map(([, {first}]) => first)), stop - this.kept);
    if (this.base === null) return;
    this.begun_s ??= 60 * Math.floor(this.base * this.width_s / 60);
    for (const [name, {first, count}] of came) this.stop[name] = first + count;
    this.last_s = Math.max(samples.last_ns, levels.last_ns) / 1e9 - this.begun_s;
    for (let k = this.base + this.x.length; k <= Math.max(this.stop.samples, this.stop.levels); k++) {
      this.x.push(k * this.width_s - this.begun_s);
    }
    const fill = (to, stream, values, c = 0) => {
      for (let i = 0, at = stream.first - this.base; i < stream.count; i++, at++) {
        if (at >= 0) this.put(to, at, values[c * stream.count + i]);
      }
    };
    if (samples.count) {
      this.channels.forEach((_, c) => {
        fill(this.curves.low[c], samples, arrays['volts/low'], c);
        fill(this.curves.high[c], samples, arrays['volts/high'], c);
      });
      fill(this.bits.truth, samples, arrays.truth);
    }
    if (levels.count) {
      this.channels.forEach((_, c) => fill(this.curves.level[c], levels, arrays['level/high'], c));
      fill(this.bits.slip, levels, arrays.slip);
    }
    if (this.x.length > 1.3 * this.kept) this.forget(this.x.length - this.kept);
  }

  // uPlot draws a line across undefined values, but not across null: columns between values that are to
  // be joined stay undefined, those in a gap become null.
  put(values, at, value) {
    if (Number.isNaN(value)) {
      values[at] = undefined;
      return;
    }
    const before = this.before.get(values);
    if (before !== undefined && at - before > this.most) values.fill(null, before + 1, at);
    values[at] = value;
    this.before.set(values, at);
  }

  forget(count) {
    this.base += count;
    this.x.splice(0, count);
    for (const values of [...Object.values(this.curves).flat(), ...Object.values(this.bits)]) {
      values.splice(0, count);
      const before = this.before.get(values);
      if (before !== undefined) this.before.set(values, before - count);
    }
  }

  // The indices of the first column between two times, and of the one after the last.
  within(from, to) {
    if (!this.x.length) return [0, 0];
    const at = (seconds) => Math.floor((seconds + this.begun_s) / this.width_s) - this.base;
    const inside = (index) => Math.max(0, Math.min(index, this.x.length));
    return [inside(at(from)), inside(at(to) + 2)];
  }

  // The lowest and the highest number in columns first to stop; null where there is none.
  static range(curves, first, stop) {
    let least = Infinity, most = -Infinity;
    for (const values of curves) {
      for (let i = first; i < stop; i++) {
        const value = values[i];
        if (value < least) least = value;
        if (value > most) most = value;
      }
    }
    return least <= most ? [least, most] : null;
  }
}

// The stretch of time that traces show, live or paused. Times are those of the columns, in seconds.
const WINDOW_S = {least: 0.5, most: 60, first: 10}, LEAST_S = 0.02;
// Delay, in seconds, after which a column is drawn, so that there is always one to draw.
const DELAY_S = 0.08;
// Columns arrive unevenly, but the axis moves evenly: with each new column it moves this share of its
// distance towards the newest. As the distance is limited, in seconds, the axis stops if nothing comes.
const FOLLOWED_SHARE = 0.04, MOST_APART_S = 0.4;

const within = (value, least, most) => Math.min(Math.max(value, least), most);

export class Stretch {
  constructor() {
    this.window_s = WINDOW_S.first;
    this.begin();
  }

  // Start over, for a finger without columns yet.
  begin() {
    this.columns = null;
    this.goOn();
  }

  // Take the columns to show; goesOn: their times continue those of the columns before.
  of(columns, goesOn) {
    this.columns = columns;
    if (!goesOn) this.offset = null;
  }

  goOn(window_s = this.window_s) {
    // A live stretch that is made longer or shorter keeps its end.
    if (!this.live || !this.columns) this.offset = null;
    this.live = true;
    this.pauses = false;
    this.window_s = within(window_s, WINDOW_S.least, WINDOW_S.most);
  }

  pause() {
    // Before the first column has come, the pause begins as soon as it comes.
    this.pauses = this.columns?.last_s == null;
    if (this.pauses) return;
    [this.from, this.to] = this.ends();
    this.live = false;
    this.window_s = this.to - this.from;
    this.paused_s = this.columns.last_s;
  }

  pauseOrGoOn() {
    if (this.live && !this.pauses) this.pause();
    else this.goOn();
  }

  // Show another stretch; how: 'zoom', 'move', 'choose' or 'whole', as Timeline has it.
  look(from, to, how) {
    if (how === 'whole') this.goOn(WINDOW_S.first);
    else if (how === 'zoom' && this.live) this.goOn(to - from);
    else this.lookBack(from, to);
  }

  lookBack(from, to) {
    if (this.live) this.pause();
    if (this.live) return;
    const span = within(to - from, LEAST_S, WINDOW_S.most), end = (from + to + span) / 2;
    // There is nothing after the beginning of the pause, and nothing older than what is kept.
    this.to = Math.min(Math.max(end, this.paused_s - WINDOW_S.most + span), this.paused_s + 0.05 * span);
    this.from = this.to - span;
    this.window_s = span;
  }

  // Note that a newer column has come.
  follow() {
    if (this.offset !== null) this.offset += FOLLOWED_SHARE * (this.ahead() - this.offset);
  }

  // How far the newest column that is drawn is ahead of this computer's clock.
  ahead() {
    return this.columns.last_s - DELAY_S - performance.now() / 1000;
  }

  // The beginning and the end of the stretch.
  ends() {
    if (!this.live) return [this.from, this.to];
    const {columns, window_s} = this;
    if (columns?.last_s == null) return [0, window_s];
    const ahead = this.ahead();
    this.offset = within(this.offset ?? ahead, ahead - MOST_APART_S, ahead + MOST_APART_S);
    // In whole columns, so that a column looks the same wherever it is.
    const to = Math.floor((performance.now() / 1000 + this.offset) / columns.width_s) * columns.width_s;
    return [to - window_s, to];
  }
}
