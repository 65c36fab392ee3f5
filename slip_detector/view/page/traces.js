// Volts and levels of the chosen channels over the last seconds, live or paused.

import {Slider, button, heightFor, oneTabStop, write} from './elements.js';
import {Columns, Stretch} from './stretch.js';

const COLORS = [
  '#0072b2', '#9a4a00', '#00664b', '#7b2d6b', '#3a3a3a', '#4f7fb8', '#8a7400', '#a34a78',
];
const SMALL = '11px system-ui, \'DejaVu Sans\', sans-serif', SLIP_HEIGHT = 16;
// Pixels at the right for the scales; of more channels, a column is two pixels wide.
const SCALE_WIDTH = 60, MOST_FINE = 8;

const wordsOfPower = (power) => (Math.abs(power) > 3 ? `1e${power}` : String(10 ** power));

export class Traces {
  // onView(changes): asks the server for another view. onSet(values): sets parameters.
  constructor(onView, onSet) {
    Object.assign(this, {onView, root: element('timeline'), readout: element('trace-readout')});
    this.stretch = new Stretch();
    // By channel, counted from 1, and of 'level': what is shown from bottom to top.
    this.ranges = new Map();
    this.chooser = new ChannelChooser(element('chooser'), () => this.layOut());
    this.line = new Slider({
      name: 'Threshold', vertical: true,
      words: (value) => `threshold ${rounded(value)}${this.unit}`,
      valueOf: (y) => this.allowed(this.levelAt(y)),
      step: (value, steps) => this.allowed(value * 1.05 ** steps),
      onMove: () => this.draw(),
      onSet: (threshold) => onSet({threshold}),
    });
    this.root.after(this.line.root);
    this.timeline = new Timeline(this.root, {
      margin: SCALE_WIDTH,
      tickText: (seconds, digits) => this.tickText(seconds, digits),
      onInterval: (from, to, how) => {
        this.stretch.change(from, to, how);
        this.ask();
      },
      onPoint: () => this.readOut(),
    });
    listen('pause', 'click', () => this.pauseOrGoOn());
    for (const id of ['same-scale', 'hold-scale']) listen(id, 'change', () => this.draw());
    new ResizeObserver(() => this.layOut()).observe(this.root);
  }

  show(finger) {
    const {name, channels} = this.finger ?? {};
    if (finger.name !== name || finger.channels.length !== channels.length) {
      this.columns = this.stretch.columns = null;
      this.stretch.goOn();
      this.ranges.clear();
      this.truth = false;
    }
    this.finger = finger;
    this.unit = finger.decision === 'evidence' ? ' dB s' : '';
    this.chooser.show(finger);
    this.layOut();
  }

  pauseOrGoOn() {
    if (this.stretch.live) this.stretch.pause();
    else this.stretch.goOn();
    this.ask();
  }

  ask() {
    if (!this.finger) return;
    [this.timeline.from, this.timeline.to] = this.stretch.ends();  // The next key goes on from it.
    const {live, window_s, to} = this.stretch, {channels} = this.chooser;
    const width = this.root.clientWidth - NAMES_WIDTH - SCALE_WIDTH;
    const pixels = clamp(Math.ceil(width / (channels.length > MOST_FINE ? 2 : 1)), 10, 4000);
    const until_ns = live || !this.columns ? null : Math.round((to + this.columns.begun_s) * 1e9);
    this.onView({channels, window_s, pixels, until_ns});
    write('pause', live ? 'Pause' : 'Go on');
    write('trace-span', `${rounded(window_s)} s${live ? '' : ', paused'}`);
    // While the traces scroll, the values under the pointer change too often to be read aloud.
    this.readout.ariaLive = live ? 'off' : 'polite';
    this.draw();
  }

  take(traces, arrays) {
    if (traces.name !== this.finger?.name) return;
    const {beginning, width_ns, channels, until_ns, samples, levels} = traces;
    const key = JSON.stringify([beginning, width_ns, channels, until_ns]);
    if (key !== this.key || !this.columns) {
      // Paused traces show the track as it was, even if it was begun again since.
      const goesOn = this.columns && (!this.stretch.live || beginning === this.beginning);
      const kept = Math.ceil(this.stretch.window_s * 1e9 / width_ns) + 4;
      this.columns = new Columns(traces, kept, goesOn ? this.columns.begun_s : null);
      this.stretch.columns = this.columns;
      [this.key, this.beginning] = [key, beginning];
    }
    this.columns.take(traces, arrays);
    this.truth ||= Boolean(samples.count && arrays.truth.includes(1));
    if (samples.count + levels.count) this.draw();
  }

  layOut() {
    if (!this.finger || !this.root.clientWidth) return;
    const {channels} = this.chooser, n = channels.length;
    const free = Math.max(heightFor(this.root, 60), 300);
    const levels = clamp(Math.round(free * 0.35), 110, 240);
    const height = clamp(Math.floor((free - levels - 2 * SLIP_HEIGHT - 30) / n), 18, 120);
    const colors = channels.map((_, i) => COLORS[i % COLORS.length]);
    const band = (name, color) => ({
      name, height: SLIP_HEIGHT,
      paint: (pen, {top}) => this.paintBits(pen, top, SLIP_HEIGHT - 1, name, color),
    });
    const paint = (pen, lane) => this.paintStrip(pen, lane);
    const paintScale = (pen, lane) => this.paintVolts(pen, lane);
    const lanes = channels.map((c, channel) => ({
      name: this.finger.channels[c - 1], kind: 'channel', height, curve: 1, below: STRIP + 3,
      colors: [colors[channel]], channel, paint, paintScale,
    }));
    const powers = (pen, lane) => (
      this.paintScale(pen, lane, this.ranges.get('level'), 1, wordsOfPower));
    const note = this.unit ? 'evidence, dB s' : 'of each channel', curves = {curve: n, colors};
    this.levels = {name: 'level', note, height: levels, ...curves, below: 2, paintScale: powers};
    const truth = this.truth ? [band('truth', LABEL)] : [];
    this.timeline.setLanes([band('slip', ON), ...truth, ...lanes, this.levels]);
    this.laidOut = this.truth;
    this.root.style.height = `${this.timeline.height}px`;
    this.ask();
  }

  draw() {
    const {columns, chooser: {channels}} = this;
    if (!this.root.clientWidth || columns?.begun_s == null) return;
    if (String(columns.channels) !== String(channels)) return;
    if (this.laidOut !== this.truth) return this.layOut();
    const [from, to] = this.stretch.ends(), seen = this.seen = columns.between(from, to);
    this.fitVolts(channels, seen);
    const curves = channels.map((c, i) => (
      {low: seen.low[i], high: seen.high[i], range: this.scaleOf(c)}));
    const range = this.levelRange(seen.level.flat());
    for (const values of seen.level) {
      const low = values.map((level) => (level == null ? null : Math.log10(level)));
      curves.push({low, high: low, range});
    }
    this.timeline.draw({
      from, to, curves,
      paint: (pen) => this.paintBits(pen, pen.top, pen.bottom, 'truth', '#e8f2f9'),
      // Without columns there is still an axis, with which the user can move elsewhere.
      x: seen.x.length ? seen.x : [from, to],
    });
    const threshold = this.line.show(this.finger.threshold, ...range.map((power) => 10 ** power));
    this.line.place(this.levelY(threshold));
    this.readOut();
    Object.assign(this.root.dataset, {fromS: from, toS: to});
  }

  // Fit the scale of each channel to its volts, unless scales are held.
  fitVolts(channels, {low, high}) {
    channels.forEach((c, i) => {
      const before = this.ranges.get(c);
      if (before && element('hold-scale').checked) return;
      const [least, most] = rangeOf(low[i].concat(high[i])) ?? before ?? [0, 1];
      const flat = least === most ? 1e-6 * (1 + Math.abs(least)) : 0;
      this.ranges.set(c, steady(before, [least - flat, most + flat], 0.45, 0.1));
    });
  }

  // The same scale has as many volts from bottom to top for all, which rest at different volts.
  scaleOf(channel) {
    const sizeOf = ([least, most]) => most - least, range = this.ranges.get(channel);
    if (!element('same-scale').checked) return range;
    const ranges = this.chooser.channels.map((c) => this.ranges.get(c));
    const more = (Math.max(...ranges.map(sizeOf)) - sizeOf(range)) / 2;
    return [range[0] - more, range[1] + more];
  }

  // The powers of ten between which levels are shown, at most five below the highest.
  levelRange(values) {
    const threshold = this.line.chosen ?? this.finger.threshold;
    const [low, high] = rangeOf([...values, threshold]), most = Math.log10(high);
    const least = Math.log10(Math.max(low, 10 ** (most - 5)));
    const wanted = [Math.floor(2 * (least - 0.1)) / 2, Math.ceil(2 * (most + 0.1)) / 2];
    // While the threshold is dragged, the range may grow but does not shrink.
    const share = this.line.chosen === null ? 0.6 : 0;
    this.ranges.set('level', steady(this.ranges.get('level'), wanted, share));
    return this.ranges.get('level');
  }

  levelAt(y) {
    const [least, most] = this.ranges.get('level');
    const bottom = this.levelY(10 ** least), top = this.levelY(10 ** most);
    return 10 ** (least + clamp((bottom - y) / (bottom - top), 0, 1) * (most - least));
  }

  // The threshold of evidence is below its limit.
  allowed(threshold) {
    const {evidence_limit_db_s: limit} = this.finger;
    return rounded(this.unit ? Math.min(threshold, 0.99 * limit) : threshold);
  }

  levelY(level) {
    return Timeline.yOf(this.levels, this.ranges.get('level'), Math.log10(level));
  }

  paintColumns({context, xOf}, top, height, values, colorOf) {
    const {seen: {x: [begin]}, columns: {width_s: width}} = this;
    const color = (i) => colorOf(values[i]);
    paintRuns(context, top, height, 0, values.length, color, (i) => xOf(begin + i * width));
  }

  paintBits(pen, top, height, name, color) {
    this.paintColumns(pen, top, height, this.seen[name][0], (bit) => (bit ? color : null));
  }

  // A strip under a channel's volts whose colour tells how near the level is to the threshold.
  paintStrip(pen, {top, height, channel}) {
    const {threshold} = this.finger;
    const colorOf = (level) => (level == null ? HATCHING : shade(Math.log2(level / threshold)));
    this.paintColumns(pen, top + height - STRIP - 1, STRIP, this.seen.level[channel], colorOf);
  }

  // Round values at the right of a lane, where no curve is.
  paintScale({context, right}, lane, range, step, words) {
    Object.assign(context, {font: SMALL, textAlign: 'left', fillStyle: INK});
    for (let n = Math.ceil(range[0] / step), last = Infinity; n * step <= range[1]; n++) {
      const y = Timeline.yOf(lane, range, n * step);
      if (last - y < 12) continue;
      last = y;
      context.fillRect(right, y, 4, 1);
      const middle = clamp(y, lane.top + 5, lane.top + lane.height - 5);
      context.fillText(words(n * step), right + 7, middle);
    }
  }

  paintVolts(pen, lane) {
    const scale = this.scaleOf(this.chooser.channels[lane.channel]), [least, most] = scale;
    const power = 10 ** Math.floor(Math.log10(most - least));
    const step = power * [0.5, 1, 2, 5].find((n) => n * power * 4 > most - least);
    const [factor, unit] = Math.max(-least, most) < 0.1 ? [1e3, 'mV'] : [1, 'V'];
    const digits = Math.max(0, -Math.floor(Math.log10(step * factor)));
    this.paintScale(pen, lane, scale, step, (v) => `${(v * factor).toFixed(digits)} ${unit}`);
  }

  tickText(seconds, digits = 3) {
    const total = seconds + (this.columns?.begun_s ?? 0);
    // Of a recording that is played: from which stamp on which place, or null; in seconds.
    if (this.places) {
      const [begin, at] = this.places.findLast(([stamp]) => stamp < total + 1e-4) ?? [0, null];
      return at === null ? '' : `${(at + total - begin).toFixed(digits)} s`;
    }
    // The time of day if the stamps are dates; simulated time begins at zero.
    if (total < 1e9) return `${total.toFixed(digits)} s`;
    const zone_s = 60 * new Date(1000 * total).getTimezoneOffset();
    return timeText(Number(total.toFixed(digits)) - zone_s, digits);
  }

  readOut() {
    const {pointed, pointedLane} = this.timeline, isRead = pointed !== null && this.seen;
    write(this.readout, isRead ? this.wordsAt(pointed, pointedLane).join(' \u00b7 ') : '\u00a0');
  }

  wordsAt(seconds, lane) {
    const {x, low, high, level, ...bits} = this.seen, {threshold, channels: names} = this.finger;
    const at = Math.floor((seconds - x[0]) / this.columns.width_s);
    const levelWords = (i) => {
      const value = level[i][at];
      if (value == null) return 'not valid';
      return `level ${rounded(value)}${this.unit}, ${rounded(value / threshold)} of the threshold`;
    };
    const words = [this.tickText(seconds)];
    if (lane?.channel !== undefined) {
      const [least, most] = [low, high].map((values) => values[lane.channel][at]);
      const read = least == null ? 'no sample' : voltsBetween(least, most);
      words.push(lane.name, read, levelWords(lane.channel));
    } else if (lane === this.levels) {
      const valid = [...level.keys()].filter((i) => level[i][at] != null);
      const loudest = valid.sort((a, b) => level[b][at] - level[a][at]).slice(0, 4);
      words.push(...loudest.map((i) => `${names[this.chooser.channels[i] - 1]} ${levelWords(i)}`));
    } else if (lane) {
      words.push(`${lane.name} ${bits[lane.name][0][at] ? 'ON' : 'OFF'}`);
    }
    return words;
  }
}

// Most channels that the server sends at once.
const MOST_CHANNELS = 64;

// Which channels of a finger have traces: a button for each, under its group.
class ChannelChooser {
  constructor(root, onChoose) {
    Object.assign(this, {root, onChoose});
    // By finger, its channels that were chosen last, counted from 1, in order.
    this.kept = new Map();
    oneTabStop(root);
  }

  get channels() {
    return this.kept.get(this.name) ?? [];
  }

  // Show the channels of a finger: those that were chosen before, else its first group.
  show({name, channels, groups, disabled}) {
    const described = JSON.stringify([name, channels, groups, disabled]);
    if (described === this.described) return;
    Object.assign(this, {described, name});
    const grouped = Object.values(groups).flat(), every = channels.map((_, c) => c + 1);
    const others = every.filter((c) => !grouped.includes(c) && !disabled.includes(c));
    const sets = Object.entries(groups);
    if (others.length) sets.push(['no group', others]);
    this.root.replaceChildren(...sets.map(([set, members]) => {
      const whole = {className: 'whole-set', title: `The traces of ${set} and of no other`};
      const each = members.map((c) => this.buttonOf(c, channels[c - 1]));
      return build('span.channel-set', button(set, () => this.choose(members), whole), ...each);
    }));
    this.root.querySelectorAll('button').forEach((each, i) => (each.tabIndex = i ? -1 : 0));
    const kept = this.channels, first = Object.values(groups)[0] ?? [1];
    const fits = kept.length && kept.at(-1) <= channels.length;
    this.choose(fits ? kept : first.slice(0, 4));
  }

  buttonOf(channel, name) {
    const properties = {ariaLabel: `Traces of ${name}`, title: name, dataset: {channel}};
    return button(String(channel), () => this.toggle(channel), properties);
  }

  // Add or remove a channel; the last one stays.
  toggle(channel) {
    const rest = this.channels.filter((c) => c !== channel);
    if (rest.length === this.channels.length) rest.push(channel);
    if (rest.length && rest.length <= MOST_CHANNELS) this.choose(rest);
  }

  choose(channels) {
    this.kept.set(this.name, channels.slice(0, MOST_CHANNELS).sort((a, b) => a - b));
    for (const each of this.root.querySelectorAll('[data-channel]')) {
      each.ariaPressed = String(this.channels.includes(Number(each.dataset.channel)));
    }
    this.onChoose();
  }
}
