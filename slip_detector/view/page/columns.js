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
