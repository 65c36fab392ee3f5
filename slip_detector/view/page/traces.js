// Volts and levels of the chosen channels over the last seconds, live or paused. Times are in seconds
// since a whole minute before the first column.

import {build, button} from './elements.js';
import {Slider, rounded} from './slider.js';
import {Columns, Stretch} from './stretch.js';

// Lines are told apart by lightness, too.
const COLORS = ['#0072b2', '#9a4a00', '#00664b', '#7b2d6b', '#3a3a3a', '#4f7fb8', '#8a7400', '#a34a78'];
const SLIP_HEIGHT = 16, LEVEL_HEIGHT = {least: 110, most: 190};

export class Traces {
  // panel: an empty element. onView(changes): called to change what the server is asked for.
  // onSet(values): called to set parameters; resolves when the change was answered.
  constructor(panel, {onView, onSet}) {
    Object.assign(this, {onView, onSet});
    this.stretch = new Stretch();
    this.columns = null;
    this.ranges = new Map();
    this.pointed = null;
    this.truth = false;
    this.build(panel);
  }

  build(panel) {
    this.pauseButton = button('Pause', () => this.pauseOrGoOn());
    const named = (words, ariaLabel, act) => button(words, act, {ariaLabel, title: ariaLabel});
    this.span = build('span.span', {id: 'trace-span'});
    const bar = build('div.trace-bar', this.pauseButton, named('+', 'Shorter stretch of time', () => this.zoom(0.5)),
      named('\u2212', 'Longer stretch of time', () => this.zoom(2)), this.span);
    this.chooser = new ChannelChooser(() => this.layOut());
    this.root = build('div', {
      id: 'timeline', tabIndex: 0, role: 'group',
      ariaLabel: 'Traces of the chosen channels over time; keys: plus, minus, arrows, Home; values: Shift and arrows',
    });
    this.line = new Slider({
      name: 'Threshold', vertical: true, words: (value) => `threshold ${rounded(value)}${this.unit}`,
      valueOf: (y) => rounded(this.levelAt(y)), step: (value, steps) => rounded(value * 1.05 ** steps),
      onMove: () => this.draw(),
      onSet: (threshold) => this.onSet({threshold}),
    });
    this.readout = build('p.readout', '\u00a0');
    panel.append(bar, this.chooser.root, build('div.trace-frame', this.root, this.line.root), this.readout);
    this.timeline = new Timeline(this.root, {
      tickText: (seconds, step) => this.tickText(seconds, step),
      onLook: (from, to, how) => this.look(from, to, how),
      onPoint: (seconds, lane) => this.point(seconds, lane),
      onClick: () => {},
    });
    this.root.addEventListener('pointerleave', () => this.point(null));
    this.root.addEventListener('blur', () => {
      this.timeline.showPointer(null);
      this.point(null);
    });
    this.root.addEventListener('keydown', (event) => this.onKey(event));
    new ResizeObserver(() => this.layOut()).observe(this.root);
  }

  // Show another finger, or the same with other parameters.
  show(finger) {
    if (finger.name !== this.finger?.name || finger.channels.length !== this.finger.channels.length) {
      this.columns = null;
      this.stretch.begin();
      this.truth = false;
    }
    this.finger = finger;
    this.unit = finger.decision === 'evidence' ? ' dB s' : '';
    this.chooser.show(finger);
    this.layOut();
  }

  // Allow the threshold to be dragged, or not with --read-only.
  allowChanges(allowed) {
    this.line.root.ariaDisabled = String(!allowed);
  }

  // End changes of this finger before another one is shown.
  settle() {
    this.line.settle();
  }

  get channels() {
    return this.chooser.channels;
  }

  toggle(channel) {
    this.chooser.toggle(channel);
  }

  // ---- which stretch of time

  pauseOrGoOn() {
    this.stretch.pauseOrGoOn();
    this.ask();
  }

  zoom(factor) {
    const [from, to] = this.stretch.ends(), middle = (from + to) / 2, half = factor * (to - from) / 2;
    this.look(middle - half, middle + half, 'zoom');
  }

  look(from, to, how) {
    this.stretch.look(from, to, how);
    this.ask();
  }

  onKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target !== this.root) return;
    const [from, to] = this.stretch.ends(), tenth = (to - from) / 10, move = (by) => this.look(from + by, to + by, 'move');
    const act = (event.shiftKey ? {
      ArrowLeft: () => this.pointElsewhere(-0.01, 0), ArrowRight: () => this.pointElsewhere(0.01, 0),
      ArrowUp: () => this.pointElsewhere(0, -1), ArrowDown: () => this.pointElsewhere(0, 1),
    } : {
      ArrowLeft: () => move(-tenth), ArrowRight: () => move(tenth), PageUp: () => move(-9 * tenth), PageDown: () => move(9 * tenth),
    })[event.key] ?? {
      '+': () => this.zoom(0.5), '=': () => this.zoom(0.5), '-': () => this.zoom(2), Home: () => this.look(0, 0, 'whole'),
    }[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  }

  // ---- what the server is asked, and what comes

  ask() {
    if (!this.finger) return;
    const pixels = Math.max(10, Math.min(4000, this.root.clientWidth - NAMES_WIDTH - RIGHT_MARGIN));
    const {live, window_s, to} = this.stretch;
    this.onView({
      channels: this.channels, window_s, pixels,
      until_ns: live || !this.columns ? null : Math.round((to + this.columns.begun_s) * 1e9),
    });
    this.pauseButton.textContent = live ? 'Pause' : 'Go on';
    this.span.textContent = `${rounded(window_s)} s${live ? '' : ', paused'}`;
    // While the traces scroll, the values under the pointer change too often to be read aloud.
    this.readout.ariaLive = live ? 'off' : 'polite';
    this.draw();
  }

  take(traces, arrays) {
    if (traces.name !== this.finger?.name) return;
    const key = JSON.stringify([traces.name, traces.beginning, traces.width_ns, traces.channels, traces.until_ns ?? null]);
    if (key !== this.key || !this.columns) {
      // Paused traces show the track as it was, even if it was begun again since.
      const goesOn = this.columns !== null && (!this.stretch.live || String(traces.beginning) === String(this.beginning));
      const kept = Math.ceil(this.stretch.window_s * 1e9 / traces.width_ns) + 4;
      this.columns = new Columns(traces, kept, 1 / this.finger.sample_rate_hz, goesOn ? this.columns.begun_s : null);
      this.stretch.of(this.columns, goesOn);
      [this.key, this.beginning] = [key, traces.beginning];
    }
    const before = this.columns.last_s;
    this.columns.take(traces, arrays);
    if (this.columns.last_s !== before) this.stretch.follow();
    this.came ||= traces.samples.count + traces.levels.count > 0;
    this.truth ||= Boolean(traces.samples.count && arrays.truth.includes(1));
    if (this.stretch.pauses) {
      this.stretch.pause();
      this.ask();
    }
  }

  // ---- drawing

  layOut() {
    if (!this.finger || !this.root.clientWidth) return;
    const {channels} = this, n = channels.length, top = this.root.getBoundingClientRect().top + window.scrollY;
    const free = Math.max(window.innerHeight - top - 60, 300);
    const levels = Math.max(LEVEL_HEIGHT.least, Math.min(LEVEL_HEIGHT.most, Math.round(free * 0.35)));
    const height = Math.max(18, Math.min(60, Math.floor((free - levels - 2 * SLIP_HEIGHT - 30) / n)));
    const band = (bits, color) => (pen, lane) => this.paintBits(pen, lane, bits, color);
    this.volts = channels.map((c, i) => ({
      name: this.finger.channels[c - 1], className: 'channel', height, curve: 1, colors: [COLORS[i % COLORS.length]],
      below: STRIP + 3, channel: i, paint: (pen, lane) => this.paintStrip(pen, lane),
    }));
    this.levels = {
      name: 'level', note: this.finger.decision === 'evidence' ? 'evidence, dB s' : 'of each channel', height: levels, curve: n,
      colors: channels.map((_, i) => COLORS[i % COLORS.length]), below: 2, paint: (pen, lane) => this.paintDecades(pen, lane),
    };
    this.timeline.setLanes([
      {name: 'slip', height: SLIP_HEIGHT, paint: band('slip', ON)},
      ...(this.truth ? [{name: 'truth', height: SLIP_HEIGHT, paint: band('truth', LABEL)}] : []),
      ...this.volts, this.levels,
    ]);
    this.laidOut = this.truth;
    // The lane under the pointer no longer exists.
    this.pointed = null;
    this.root.style.height = `${this.timeline.height}px`;
    this.ask();
  }

  // Called with each frame: draw if a column has come or the axis has moved by one.
  refresh() {
    const [from, to] = this.stretch.ends(), {dataset} = this.root;
    if (this.came || Number(dataset.fromS) !== from || Number(dataset.toS) !== to) this.draw();
  }

  // Draw the present state, unless the panel is hidden.
  draw() {
    const {columns} = this;
    if (!this.root.clientWidth || columns?.begun_s == null || String(columns.channels) !== String(this.channels)) return;
    if (this.laidOut !== this.truth) this.layOut();
    this.came = false;
    const [from, to] = this.stretch.ends(), [first, stop] = columns.within(from, to);
    const {low, high, level} = columns.curves;
    const curves = this.volts.map((_, i) => ({
      rows: [], low: low[i], high: high[i], range: this.steady(`volts ${this.channels[i]}`, Columns.range([low[i], high[i]], first, stop)),
    }));
    this.scale = this.levelScale(first, stop);
    const [least] = this.scale, logarithm = (value) => (value == null ? value : Math.max(least, Math.log10(value)));
    for (const values of level) curves.push({rows: values.map(logarithm), low: [], high: [], range: this.scale});
    // Without columns there is still an axis, with which the user can move elsewhere.
    const x = columns.x.length ? columns.x : [from, to];
    this.timeline.draw({from, to, x, curves, steps: false, paint: (pen) => this.paintTruth(pen)});
    this.placeLine();
    this.readOut(from, to);
    Object.assign(this.root.dataset, {fromS: from, toS: to});
  }

  // A range that grows at once but shrinks only when the curve fills less than half of it: one that
  // followed each value would make the curve jump.
  steady(name, range) {
    if (!range) return this.ranges.get(name) ?? [0, 1];
    let [least, most] = range;
    if (most === least) [least, most] = [least - 1e-6 - Math.abs(least) * 1e-6, most + 1e-6 + Math.abs(most) * 1e-6];
    const before = this.ranges.get(name), size = most - least;
    const fits = before && least >= before[0] && most <= before[1] && size > 0.45 * (before[1] - before[0]);
    if (!fits) this.ranges.set(name, [least - 0.1 * size, most + 0.1 * size]);
    return this.ranges.get(name);
  }

  // The powers of ten between which levels are shown. They include the threshold and all levels, but
  // go at most five powers below the highest.
  levelScale(first, stop) {
    const found = Columns.range(this.columns.curves.level, first, stop) ?? [this.finger.threshold, this.finger.threshold];
    const threshold = this.line.chosen ?? this.finger.threshold;
    const most = Math.log10(Math.max(found[1], threshold)), least = Math.log10(Math.max(Math.min(found[0], threshold), 10 ** (most - 5)));
    const before = this.ranges.get('level');
    const whole = [Math.floor(2 * (least - 0.1)) / 2, Math.ceil(2 * (most + 0.1)) / 2];
    // While the threshold is dragged, the scale may grow but does not shrink.
    const keep = before && least >= before[0] && most <= before[1] && (this.line.isMoved || whole[1] - whole[0] > 0.6 * (before[1] - before[0]));
    if (!keep) this.ranges.set('level', whole);
    return this.ranges.get('level');
  }

  // Pixels of the lane of levels, from its top to its bottom.
  levelPixels() {
    return [this.levels.top + 1, this.levels.top + this.levels.height - this.levels.below];
  }

  levelAt(y) {
    const [top, bottom] = this.levelPixels(), [least, most] = this.scale;
    return 10 ** Math.max(least, Math.min(most, least + (bottom - y) / (bottom - top) * (most - least)));
  }

  levelY(value) {
    const [top, bottom] = this.levelPixels(), [least, most] = this.scale;
    return bottom - (Math.log10(value) - least) / (most - least) * (bottom - top);
  }

  placeLine() {
    const [least, most] = this.scale;
    this.line.place(this.levelY(this.line.show(this.finger.threshold, 10 ** least, 10 ** most)));
  }

  paintBits({context, left, right, xOf}, lane, name, color) {
    const bits = this.columns.bits[name], {x, width_s} = this.columns;
    if (!x.length) return;
    const colorAt = (i) => (bits[i] ? color : null);
    paintRuns(context, lane.top, lane.height - 1, 0, bits.length, colorAt, (i) => Math.min(Math.max(xOf(x[i] ?? x.at(-1) + width_s), left), right));
  }

  paintTruth(pen) {
    const {context, left, right, top, bottom} = pen;
    context.fillStyle = '#fff';
    context.fillRect(left, top, right - left, bottom - top);
    this.paintBits(pen, {top, height: bottom - top + 1}, 'truth', '#e8f2f9');
  }

  // A strip under a channel's volts whose colour tells how near the level is to the threshold.
  paintStrip({context, xOf}, lane) {
    const {x, curves, stop, base} = this.columns, level = curves.level[lane.channel];
    const {threshold} = this.finger, last = Math.min(stop.levels - base, level.length), most = this.columns.most;
    let without = 0, color = null;
    const colorAt = (i) => {
      // Columns between two levels that are to be joined keep the colour.
      if (level[i] == null) return ++without <= most ? color : hatching(context);
      without = 0;
      color = shade(Math.log2(level[i] / threshold));
      return color;
    };
    paintRuns(context, lane.top + lane.height - STRIP - 1, STRIP, 0, last, colorAt, (i) => xOf(x[i] ?? x.at(-1)));
  }

  paintDecades({context, left, right}, lane) {
    const [least, most] = this.scale;
    context.fillStyle = '#f7f8f9';
    context.fillRect(left, lane.top, right - left, lane.height);
    context.font = '11px system-ui, \'DejaVu Sans\', sans-serif';
    context.textBaseline = 'bottom';
    context.textAlign = 'left';
    for (let power = Math.ceil(least); power <= most; power++) {
      const y = this.levelY(10 ** power);
      context.fillStyle = '#d5dade';
      context.fillRect(left, y, right - left, 1);
      if (y < lane.top + 12) continue;
      context.fillStyle = '#4a525a';
      context.fillText(power < -3 || power > 3 ? `1e${power}` : String(10 ** power), left + 3, y);
    }
  }

  // ---- words

  tickText(seconds, step) {
    const total = seconds + (this.columns?.begun_s ?? 0), digits = step >= 1 ? 0 : Math.min(3, Math.ceil(-Math.log10(step) - 1e-9));
    // The time of day if the stamps are dates; simulated time begins at zero.
    if (total < 1e9) return `${total.toFixed(digits)} s`;
    const tenths = Number(total.toFixed(digits)), date = new Date(1000 * Math.floor(tenths + 1e-6));
    const rest = digits ? (tenths - Math.floor(tenths)).toFixed(digits).slice(1) : '';
    return date.toTimeString().slice(0, 8) + rest;
  }

  point(seconds, lane) {
    const [from, to] = this.stretch.ends();
    this.pointed = seconds === null ? null : {share: (seconds - from) / (to - from), lane};
    if (!this.stretch.live) this.readOut(from, to);
  }

  // Move the pointer by keys: to the right by a share of the stretch, down by a number of lanes.
  pointElsewhere(share, down) {
    const {lanes} = this.timeline, [from, to] = this.stretch.ends(), at = lanes.indexOf(this.pointed?.lane);
    const lane = lanes[at < 0 ? lanes.indexOf(this.volts[0]) : Math.min(Math.max(at + down, 0), lanes.length - 1)];
    const there = Math.min(Math.max((this.pointed?.share ?? 0.9) + share, 0), 1);
    this.timeline.showPointer(from + there * (to - from), lane);
    this.point(from + there * (to - from), lane);
  }

  readOut(from, to) {
    const words = this.pointed ? this.pointedWords(from + this.pointed.share * (to - from)) : [];
    this.readout.textContent = words.join(' \u00b7 ') || '\u00a0';
  }

  pointedWords(seconds) {
    const {columns} = this, at = Math.floor((seconds + columns.begun_s) / columns.width_s) - columns.base;
    const words = [this.tickText(seconds, 0.001)], {lane} = this.pointed;
    // The value of a column, or if it has none, of the last one before it that has.
    const back = (values) => {
      for (let i = at; i >= Math.max(0, at - columns.most); i--) if (values[i] != null) return values[i];
      return null;
    };
    const {low, high, level} = columns.curves;
    const levelWords = (i) => {
      const value = back(level[i]);
      return value === null ? 'not valid' : `level ${rounded(value)}${this.unit}, ${rounded(value / this.finger.threshold)} of the threshold`;
    };
    if (lane?.channel !== undefined) {
      const [least, most] = [back(low[lane.channel]), back(high[lane.channel])];
      words.push(lane.name, least === null ? 'no sample' : most > least ? `${volts(least)} to ${volts(most)}` : volts(least));
      words.push(levelWords(lane.channel));
    } else if (lane === this.levels) {
      const found = this.channels.map((c, i) => [back(level[i]), i]).filter(([value]) => value !== null).sort(([a], [b]) => b - a);
      for (const [, i] of found.slice(0, 4)) words.push(`${this.finger.channels[this.channels[i] - 1]} ${levelWords(i)}`);
    } else if (lane) {
      words.push(`${lane.name} ${columns.bits[lane.name]?.[at] ? 'ON' : 'OFF'}`);
    }
    return words;
  }
}

// Which channels of a finger have traces: a button for each, under its group.
// Most channels that the server sends at once.
const MOST_CHANNELS = 64;

class ChannelChooser {
  // onChoose(): called when other channels are chosen.
  constructor(onChoose) {
    this.onChoose = onChoose;
    this.root = build('div.chooser', {role: 'group', ariaLabel: 'Channels with traces'});
    // The chosen channels, counted from 1, in order; and those last chosen for each finger, by name.
    this.channels = [];
    this.kept = new Map();
  }

  // Show the channels of a finger: those that were chosen before, else its first group.
  show({name, channels, groups, disabled}) {
    const described = JSON.stringify([name, channels, groups, disabled]);
    if (described === this.described) return;
    this.described = described;
    this.name = name;
    const kept = this.kept.get(name) ?? [];
    const chosen = kept.length && kept.at(-1) <= channels.length ? kept : (Object.values(groups)[0] ?? [1]).slice(0, 4);
    this.fill(channels, groups, disabled);
    this.take(chosen);
  }

  fill(channels, groups, disabled) {
    const grouped = new Set(Object.values(groups).flat());
    const left = channels.map((_, c) => c + 1).filter((c) => !grouped.has(c) && !disabled.includes(c));
    const sets = [...Object.entries(groups), ...(left.length ? [['no group', left]] : [])];
    this.root.replaceChildren(...sets.map(([name, members]) => {
      const whole = button(name, () => this.choose(members), {className: 'whole-set', title: `The traces of ${name} and of no other`});
      return build('span.channel-set', whole, ...members.map((c) => {
        const one = button(String(c), () => this.toggle(c), {ariaLabel: `Traces of ${channels[c - 1]}`, title: channels[c - 1]});
        one.dataset.channel = c;
        return one;
      }));
    }));
  }

  // Add or remove a channel; the last one stays.
  toggle(channel) {
    const rest = this.channels.filter((c) => c !== channel);
    if (rest.length === this.channels.length) rest.push(channel);
    if (rest.length && rest.length <= MOST_CHANNELS) this.choose(rest);
  }

  choose(channels) {
    this.take(channels);
    this.onChoose();
  }

  take(channels) {
    this.channels = channels.slice(0, MOST_CHANNELS).sort((a, b) => a - b);
    this.kept.set(this.name, this.channels);
    for (const one of this.root.querySelectorAll('[data-channel]')) {
      const chosen = this.channels.includes(Number(one.dataset.channel));
      one.ariaPressed = String(chosen);
      one.disabled = !chosen && this.channels.length === MOST_CHANNELS;
    }
  }
}
