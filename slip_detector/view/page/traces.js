// Volts and levels of the chosen channels over the last seconds, live or paused. Times are in seconds
// since a whole minute before the first column.

import {Slider, button, heightFor, rounded, steady} from './elements.js';
import {Columns, Stretch} from './stretch.js';

// Lines are told apart by lightness, too.
const COLORS = ['#0072b2', '#9a4a00', '#00664b', '#7b2d6b', '#3a3a3a', '#4f7fb8', '#8a7400', '#a34a78'];
const SMALL = '11px system-ui, \'DejaVu Sans\', sans-serif', SLIP_HEIGHT = 16, LEVEL_HEIGHT = {least: 110, most: 240};
// Values up to so many sample periods apart are joined by a line.
const JOINED_PERIODS = 3;

export class Traces {
  // onView(changes): called to change what the server is asked for. onSet(values): called to set
  // parameters; resolves when the change was answered.
  constructor({onView, onSet}) {
    this.onView = onView;
    this.root = element('timeline');
    this.readout = element('trace-readout');
    this.stretch = new Stretch();
    this.columns = null;
    this.ranges = new Map();
    this.truth = false;
    this.chooser = new ChannelChooser(element('chooser'), () => this.layOut());
    this.line = new Slider({
      name: 'Threshold', vertical: true, words: (value) => `threshold ${rounded(value)}${this.unit}`,
      valueOf: (y) => rounded(this.levelAt(y)), step: (value, steps) => rounded(value * 1.05 ** steps),
      onMove: () => this.draw(),
      onSet: (threshold) => onSet({threshold}),
    });
    this.root.after(this.line.root);
    this.timeline = new Timeline(this.root, {
      tickText: (seconds, digits) => this.tickText(seconds, digits),
      onInterval: (from, to, how) => {
        this.stretch.change(from, to, how);
        this.ask();
      },
      onPoint: () => this.readOut(),
    });
    element('pause').addEventListener('click', () => this.pauseOrGoOn());
    new ResizeObserver(() => this.layOut()).observe(this.root);
  }

  show(finger) {
    if (finger.name !== this.finger?.name || finger.channels.length !== this.finger.channels.length) {
      this.columns = this.stretch.columns = null;
      this.stretch.goOn();
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
    const pixels = Math.max(10, Math.min(4000, this.root.clientWidth - NAMES_WIDTH - RIGHT_MARGIN));
    const {live, window_s, to} = this.stretch;
    this.onView({
      channels: this.chooser.channels, window_s, pixels,
      until_ns: live || !this.columns ? null : Math.round((to + this.columns.begun_s) * 1e9),
    });
    element('pause').textContent = live ? 'Pause' : 'Go on';
    element('trace-span').textContent = `${rounded(window_s)} s${live ? '' : ', paused'}`;
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
      this.columns = this.stretch.columns = new Columns(traces, kept, goesOn ? this.columns.begun_s : null);
      [this.key, this.beginning] = [key, beginning];
    }
    this.columns.take(traces, arrays);
    this.truth ||= Boolean(samples.count && arrays.truth.includes(1));
    if (samples.count + levels.count) this.draw();
  }

  layOut() {
    if (!this.finger || !this.root.clientWidth) return;
    const {channels} = this.chooser, n = channels.length, free = Math.max(heightFor(this.root, 60), 300);
    const levels = Math.max(LEVEL_HEIGHT.least, Math.min(LEVEL_HEIGHT.most, Math.round(free * 0.35)));
    const height = Math.max(18, Math.min(120, Math.floor((free - levels - 2 * SLIP_HEIGHT - 30) / n)));
    const colors = channels.map((_, i) => COLORS[i % COLORS.length]);
    const band = (name, color) => ({name, height: SLIP_HEIGHT, paint: (pen, lane) => this.paintBits(pen, lane, name, color)});
    this.scale = `lane-${n}`; // Of the first curve of levels.
    this.levels = {
      name: 'level', note: this.unit ? 'evidence, dB s' : 'of each channel', height: levels, curve: n, colors, below: 2,
      paint: (pen, lane) => this.paintDecades(pen, lane),
    };
    this.timeline.setLanes([
      band('slip', ON),
      ...(this.truth ? [band('truth', LABEL)] : []),
      ...channels.map((c, i) => ({
        name: this.finger.channels[c - 1], kind: 'channel', height, curve: 1, colors: [colors[i]],
        below: STRIP + 3, channel: i, paint: (pen, lane) => this.paintStrip(pen, lane),
        paintAbove: (pen, lane) => this.paintVolts(pen, lane),
      })),
      this.levels,
    ]);
    this.laidOut = this.truth;
    this.root.style.height = `${this.timeline.height}px`;
    this.ask();
  }

  draw() {
    const {columns, chooser: {channels}} = this;
    if (!this.root.clientWidth || columns?.begun_s == null || String(columns.channels) !== String(channels)) return;
    if (this.laidOut !== this.truth) return this.layOut();
    const joined = JOINED_PERIODS / this.finger.sample_rate_hz;
    // How many columns may lie between two values that are joined.
    this.joined = Math.ceil(joined / columns.width_s);
    const [from, to] = this.stretch.ends(), seen = this.seen = columns.between(from, to);
    const curves = channels.map((c, i) => ({
      rows: [], low: seen.low[i], high: seen.high[i], range: this.voltsRange(c, [seen.low[i], seen.high[i]].flat()),
    }));
    const range = this.levelRange(seen.level.flat()), logarithm = (level) => (level == null ? level : Math.max(range[0], Math.log10(level)));
    for (const values of seen.level) curves.push({rows: values.map(logarithm), low: [], high: [], range});
    this.timeline.draw({
      from, to, curves, joined, paint: (pen) => this.paintBits(pen, {top: pen.top, height: pen.bottom}, 'truth', '#e8f2f9'),
      // Without columns there is still an axis, with which the user can move elsewhere.
      x: seen.x.length ? seen.x : [from, to],
    });
    this.line.place(this.levelY(this.line.show(this.finger.threshold, ...range.map((power) => 10 ** power))));
    this.readOut();
    Object.assign(this.root.dataset, {fromS: from, toS: to});
  }

  voltsRange(channel, values) {
    const before = this.ranges.get(channel), range = rangeOf(values);
    if (!range) return before ?? [0, 1];
    const [least, most] = range, flat = least === most ? 1e-6 * (1 + Math.abs(least)) : 0;
    this.ranges.set(channel, steady(before, [least - flat, most + flat], 0.45, 0.1));
    return this.ranges.get(channel);
  }

  // The powers of ten between which levels are shown. They include the threshold and all levels, but
  // go at most five powers below the highest.
  levelRange(values) {
    const threshold = this.line.chosen ?? this.finger.threshold, [low, high] = rangeOf(values) ?? [threshold, threshold];
    const most = Math.log10(Math.max(high, threshold)), least = Math.log10(Math.max(Math.min(low, threshold), 10 ** (most - 5)));
    const wanted = [Math.floor(2 * (least - 0.1)) / 2, Math.ceil(2 * (most + 0.1)) / 2];
    // While the threshold is dragged, the range may grow but does not shrink.
    this.ranges.set('level', steady(this.ranges.get('level'), wanted, this.line.chosen === null ? 0.6 : 0));
    return this.ranges.get('level');
  }

  levelAt(y) {
    const [least, most] = this.ranges.get('level');
    return 10 ** Math.max(least, Math.min(most, this.timeline.plot.posToVal(y - AXIS_HEIGHT, this.scale)));
  }

  levelY(level) {
    return AXIS_HEIGHT + this.timeline.plot.valToPos(Math.log10(level), this.scale);
  }

  paintBits(pen, {top, height}, name, color) {
    const [bits] = this.seen[name], xOf = (i) => pen.xOf(this.seen.x[0] + i * this.columns.width_s);
    paintRuns(pen.context, top, height - 1, 0, bits.length, (i) => (bits[i] ? color : null), xOf);
  }

  // A strip under a channel's volts whose colour tells how near the level is to the threshold.
  paintStrip(pen, lane) {
    const level = this.seen.level[lane.channel], {joined} = this, {threshold} = this.finger;
    const xOf = (i) => pen.xOf(this.seen.x[0] + i * this.columns.width_s);
    let without = 0, color = null;
    const colorAt = (i) => {
      // Columns between two levels that are to be joined keep the colour.
      if (level[i] == null) return ++without <= joined ? color : HATCHING;
      without = 0;
      color = shade(Math.log2(level[i] / threshold));
      return color;
    };
    paintRuns(pen.context, lane.top + lane.height - STRIP - 1, STRIP, 0, level.length, colorAt, xOf);
  }

  paintDecades({context, left, right}, lane) {
    const [least, most] = this.ranges.get('level');
    context.fillStyle = '#f7f8f9';
    context.fillRect(left, lane.top, right - left, lane.height);
    Object.assign(context, {font: SMALL, textBaseline: 'bottom', textAlign: 'left'});
    for (let power = Math.ceil(least); power <= most; power++) {
      const y = this.levelY(10 ** power);
      context.fillStyle = '#d5dade';
      context.fillRect(left, y, right - left, 1);
      if (y < lane.top + 12) continue;
      context.fillStyle = '#4a525a';
      context.fillText(power < -3 || power > 3 ? `1e${power}` : String(10 ** power), left + 3, y);
    }
  }

  // Round volts at the left edge of a channel's lane; with an outline, as they stand above its curve.
  paintVolts({context, left}, lane) {
    const [least, most] = this.ranges.get(this.chooser.channels[lane.channel]) ?? [], top = lane.top + 1, bottom = lane.top + lane.height - lane.below;
    const power = 10 ** Math.floor(Math.log10(most - least)), step = power * [0.5, 1, 2, 5].find((n) => n * power * 4 > most - least);
    Object.assign(context, {font: SMALL, textBaseline: 'middle', textAlign: 'left', fillStyle: INK, strokeStyle: '#ffffffd0', lineWidth: 3});
    for (let n = Math.ceil(least / step), last = Infinity; n * step <= most; n++) {
      const y = bottom - (n * step - least) / (most - least) * (bottom - top);
      if (last - y < 12) continue;
      last = y;
      const place = [`${(n * step).toFixed(Math.max(0, -Math.floor(Math.log10(step))))} V`, left + 7, Math.max(top + 5, Math.min(bottom - 4, y))];
      context.fillRect(left, y, 5, 1);
      context.strokeText(...place);
      context.fillText(...place);
    }
  }

  tickText(seconds, digits = 3) {
    const total = seconds + (this.columns?.begun_s ?? 0);
    // The time of day if the stamps are dates; simulated time begins at zero.
    if (total < 1e9) return `${total.toFixed(digits)} s`;
    return timeText(Number(total.toFixed(digits)) - 60 * new Date(1000 * total).getTimezoneOffset(), digits);
  }

  readOut() {
    const {pointed} = this.timeline;
    this.readout.textContent = pointed === null || !this.seen ? '\u00a0' : this.wordsAt(pointed, this.timeline.pointedLane).join(' \u00b7 ');
  }

  wordsAt(seconds, lane) {
    const {x, low, high, level, ...bits} = this.seen, at = Math.floor((seconds - x[0]) / this.columns.width_s);
    // The value of a column, or if it has none, of the last one before it that has.
    const back = (values) => values.slice(Math.max(0, at - this.joined), at + 1).findLast((value) => value != null) ?? null;
    const levelWords = (i) => {
      const value = back(level[i]);
      return value === null ? 'not valid' : `level ${rounded(value)}${this.unit}, ${rounded(value / this.finger.threshold)} of the threshold`;
    };
    const words = [this.tickText(seconds)];
    if (lane?.channel !== undefined) {
      const [least, most] = [back(low[lane.channel]), back(high[lane.channel])];
      words.push(lane.name, least === null ? 'no sample' : most > least ? `${volts(least)} to ${volts(most)}` : volts(least));
      words.push(levelWords(lane.channel));
    } else if (lane === this.levels) {
      const found = this.chooser.channels.map((c, i) => [back(level[i]), i]).filter(([value]) => value !== null).sort(([a], [b]) => b - a);
      for (const [, i] of found.slice(0, 4)) words.push(`${this.finger.channels[this.chooser.channels[i] - 1]} ${levelWords(i)}`);
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
  // root: an empty element. onChoose(): called when other channels are chosen.
  constructor(root, onChoose) {
    Object.assign(this, {root, onChoose});
    // By finger, its channels that were chosen last, counted from 1, in order.
    this.kept = new Map();
  }

  get channels() {
    return this.kept.get(this.name) ?? [];
  }

  // Show the channels of a finger: those that were chosen before, else its first group.
  show({name, channels, groups, disabled}) {
    const described = JSON.stringify([name, channels, groups, disabled]);
    if (described === this.described) return;
    Object.assign(this, {described, name});
    const grouped = Object.values(groups).flat();
    const others = channels.map((_, c) => c + 1).filter((c) => !grouped.includes(c) && !disabled.includes(c));
    const sets = [...Object.entries(groups), ...(others.length ? [['no group', others]] : [])];
    this.root.replaceChildren(...sets.map(([set, members]) => {
      const whole = button(set, () => this.choose(members), {className: 'whole-set', title: `The traces of ${set} and of no other`});
      return build('span.channel-set', whole, ...members.map((c) => {
        const one = button(String(c), () => this.toggle(c), {ariaLabel: `Traces of ${channels[c - 1]}`, title: channels[c - 1]});
        one.dataset.channel = c;
        return one;
      }));
    }));
    const kept = this.channels;
    this.choose(kept.length && kept.at(-1) <= channels.length ? kept : (Object.values(groups)[0] ?? [1]).slice(0, 4));
  }

  // Add or remove a channel; the last one stays.
  toggle(channel) {
    const rest = this.channels.filter((c) => c !== channel);
    if (rest.length === this.channels.length) rest.push(channel);
    if (rest.length && rest.length <= MOST_CHANNELS) this.choose(rest);
  }

  choose(channels) {
    this.kept.set(this.name, channels.slice(0, MOST_CHANNELS).sort((a, b) => a - b));
    for (const one of this.root.querySelectorAll('[data-channel]')) {
      const chosen = this.channels.includes(Number(one.dataset.channel));
      one.ariaPressed = String(chosen);
      one.disabled = !chosen && this.channels.length === MOST_CHANNELS;
    }
    this.onChoose();
  }
}
