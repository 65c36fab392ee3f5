// The spectrum of a channel, the one at rest behind it, and the bands of the chain to be dragged.

import {Slider, heightFor, update, write} from './elements.js';

const AXIS_WIDTH = 40, AXIS_DEPTH = 24, LABEL_SIZE = 18, RIGHT = 16, TOP = 8;
const HEIGHT = {least: 240, most: 560};
const NOW = {stroke: '#0072b2', width: 1.6};
const REST = {stroke: '#66717a', fill: 'rgba(90, 102, 112, 0.3)', width: 1, dash: [5, 3]};
const PASS = '#e4f1e9', STOP = '#f3e3da', COMB = '#7b2d6b';
// An upper edge above this share of half the sample rate means none: the band-pass is a high-pass.
// Below LEAST_HZ, or that share of half the sample rate, round-off would ruin the filter.
const OPEN_SHARE = 0.98, LEAST_HZ = 0.1, LEAST_SHARE = 2e-4;
const STEPS = {ArrowLeft: -1, ArrowRight: 1, PageUp: 20, PageDown: -20};

export class SpectrumPanel {
  // onView(changes): asks the server for another view. onSet(values): sets parameters.
  constructor(onView, onSet) {
    Object.assign(this, {onView, onSet, channel: null, isOpen: false, keyed: null});
    Object.assign(this, {lines: new Map(), range: [-100, 0], mains: element('mains')});
    Object.assign(this, {choice: element('spectrum-channel'), root: element('spectrum-plot')});
    Object.assign(this, {frame: element('spectrum-frame'), readout: element('spectrum-readout')});
    listen(this.choice, 'change', () => this.choose(Number(this.choice.value)));
    listen(this.mains, 'change', async () => {
      const {refusal} = await onSet({mains_hz: Number(this.mains.value)});
      if (refusal) this.updateBands();
    });
    listen(this.root, 'keydown', (event) => this.onKey(event));
    listen(this.root, 'blur pointermove', () => this.key(null));
    new ResizeObserver(() => this.layOut()).observe(this.frame);
  }

  open(isOpen) {
    this.isOpen = isOpen;
    this.ask();
    this.layOut();
  }

  show(finger) {
    const {name, channels} = this.finger ?? {};
    Object.assign(this, {finger, nyquist: finger.sample_rate_hz / 2});
    if (finger.name !== name || String(finger.channels) !== String(channels)) {
      this.now = this.rest = null;
      this.choice.replaceChildren(...finger.channels.map((each, c) => new Option(each, c + 1)));
      this.choose(Object.values(finger.groups)[0]?.[0] ?? 1);
    }
    this.updateBands();
    this.layOut();
  }

  allow(allowed) {
    this.allowed = allowed;
    element('bands').disabled = !allowed;
    for (const line of this.lines.values()) line.allow(allowed);
  }

  choose(channel) {
    this.channel = this.choice.value = channel;
    this.ask();
  }

  ask() {
    this.onView({spectrum: this.isOpen ? this.channel : null});
  }

  take({name, channel, step_hz: step, rest_step_hz: restStep}, {spectrum, rest}) {
    if (name !== this.finger?.name || channel !== this.channel) return;
    this.now = spectrum ? {step, density: Array.from(spectrum)} : null;
    this.rest = rest ? {step: restStep, density: Array.from(rest)} : null;
    this.draw();
  }

  // The edges that can be dragged, from where to where, and what sets them.
  edges() {
    const {passband_hz: pass, stopbands_hz: stops, activity_hz: [active = 0]} = this.finger;
    const {nyquist} = this, lowest = Math.max(LEAST_HZ, LEAST_SHARE * nyquist);
    const edgesOf = (band, short, [from, to], least, set) => [
      {name: `${band}, low edge`, short: `${short} from`, value: from,
        least, most: (to || nyquist) * 0.95, set: (hz) => set([hz, to])},
      {name: `${band}, high edge`, short: `${short} to`, value: to,
        least: from * 1.05, most: nyquist * 0.999, set: (hz) => set([from, hz])},
    ];
    const setPass = (band) => this.onSet({passband_hz: band});
    const edges = edgesOf('Pass-band', 'pass', pass, Math.max(lowest, active), setPass);
    stops.forEach((stop, i) => {
      const setStop = (band) => this.onSet({stopbands_hz: stops.with(i, band).flat()});
      edges.push(...edgesOf(`Stop-band ${i + 1}`, `stop ${i + 1}`, stop, lowest, setStop));
    });
    return edges;
  }

  updateBands() {
    const edges = this.edges();
    if (edges.length !== this.lines.size) {
      for (const line of this.lines.values()) line.close();
      this.lines = new Map(edges.map(({name, short}) => [name, this.lineOf(name, short)]));
      edges.forEach(({name}, row) => this.lines.get(name).root.style.setProperty('--row', row));
    }
    this.allow(this.allowed);
    const {mains_hz: mains} = this.finger;
    const isListed = [...this.mains.options].some(({value}) => Number(value) === mains);
    if (!isListed) this.mains.append(new Option(`mains ${mains} Hz`, mains));
    this.mains.value = mains;
  }

  // The line at an edge. The upper one of the pass-band, at the end of the axis, is no edge.
  lineOf(name, short) {
    const edge = () => this.edges().find((each) => each.name === name);
    const isOpen = (hz) => name === 'Pass-band, high edge' && hz >= this.nyquist * OPEN_SHARE;
    const inside = (hz) => {
      const {least, most} = edge(), within = clamp(hz, least, most);
      line.why = hz === within ? '' : ': no farther';
      if (isOpen(hz)) return 0;
      const value = rounded(within);
      return value < least || value > most ? Number(within.toPrecision(4)) : value;
    };
    const line = new Slider({
      name, vertical: false,
      valueOf: (x) => inside(this.plot.posToVal(x - this.plot.over.offsetLeft, 'x')),
      words: (hz) => `${short} ${hz ? `${hz} Hz${line.moving ? line.why : ''}` : 'all above'}`,
      step: (hz, steps) => inside((hz || this.nyquist) * 1.02 ** steps),
      onMove: () => this.draw(), onSet: (hz) => edge().set(hz),
    });
    line.root.classList.add(name.split(/[ ,]/)[0].toLowerCase());
    this.frame.append(line.root);
    return line;
  }

  layOut() {
    const width = this.frame.clientWidth;
    if (!this.finger || !width) return;
    const height = clamp(heightFor(this.frame, 110), HEIGHT.least, HEIGHT.most);
    this.frame.style.height = `${height}px`;
    this.plot ??= new uPlot(this.options(width, height), [[1], [null], [null]], this.root);
    this.plot.setSize({width, height});
    this.draw();
  }

  options(width, height) {
    const none = {show: false}, font = `12px ${FONT}`, grid = {stroke: GRID, width: 1};
    const axis = {stroke: TEXT, font, grid, ticks: none, labelSize: LABEL_SIZE, labelFont: font};
    const wordsOf = (hz) => (hz === null || !/^[125]/.test(hz.toExponential()) ? '' : String(hz));
    const x = {time: false, distr: 3, auto: false, range: () => [this.leastHz(), this.nyquist]};
    return {
      width, height, legend: none, padding: [TOP, RIGHT, 0, 0],
      scales: {x, y: {auto: false, range: () => this.range}},
      axes: [
        {...axis, size: AXIS_DEPTH, label: 'frequency, Hz', space: 24,
          filter: (_, splits) => splits, values: (_, splits) => splits.map(wordsOf)},
        {...axis, size: AXIS_WIDTH, label: 'dB of 1 V/\u221aHz'},
      ],
      series: [{}, {...REST, fillTo: () => this.range[0], points: none}, {...NOW, points: none}],
      cursor: {y: false, points: none, drag: {x: false, y: false}, bind: {dblclick: () => null}},
      hooks: {drawClear: [() => this.paintBands()], setCursor: [() => this.readOut()]},
    };
  }

  leastHz() {
    const {stopbands_hz: stops, passband_hz: [low]} = this.finger;
    return Math.min(this.now?.step ?? 0.5, ...stops.flat(), low);
  }

  draw() {
    if (!this.plot || !this.frame.clientWidth) return;
    const {now, rest} = this, density = now?.density ?? [null];
    const x = density.map((_, i) => (i + 1) * (now?.step ?? 1));
    const shadow = x.map((hz) => this.restAt(hz) ?? null);
    if (now) {
      const [low, most] = rangeOf([...density, ...(rest?.density ?? [])]);
      const least = Math.max(low, most - 120);
      const wanted = [10 * Math.floor(least / 10 - 0.3), 10 * Math.ceil(most / 10 + 0.3)];
      this.range = steady(this.range, wanted, 0.6);
    }
    this.plot.batch(() => {
      this.plot.setData([x, shadow, density], false);
      this.plot.setScale('x', {min: this.leastHz(), max: this.nyquist});
      this.plot.setScale('y', {min: this.range[0], max: this.range[1]});
    });
    const {over} = this.plot;
    for (const {name, value, least, most} of this.edges()) {
      const line = this.lines.get(name), hz = line.show(value, least, most);
      const pixel = this.plot.valToPos(hz || this.nyquist, 'x');
      line.place(over.offsetLeft + pixel);
      const {offsetWidth: wide} = line.label, isHigh = name.includes('high');
      line.root.classList.toggle('left', pixel > (isHigh ? wide : over.clientWidth - wide));
    }
    this.describe();
  }

  paintBands() {
    const {plot} = this, {ctx: context, bbox: {left, top, width, height}} = plot;
    const ratio = width / plot.over.clientWidth || 1;
    const xOf = (hz) => clamp(plot.valToPos(hz, 'x', true), left, left + width);
    const fill = (low, high, color) => {
      context.fillStyle = color;
      context.fillRect(xOf(low), top, xOf(high) - xOf(low), height);
    };
    const valueOf = ({name, value}) => this.lines.get(name)?.chosen ?? value;
    const [from, to, ...others] = this.edges().map(valueOf);
    context.save();
    fill(from, to || this.nyquist, PASS);
    this.finger.stopbands_hz.forEach((_, i) => {
      const [low, high] = others.slice(2 * i);
      fill(low, high, STOP);
      // Hatched, too: not by colour alone.
      context.globalAlpha = 0.4;
      fill(low, high, HATCHING);
      context.globalAlpha = 1;
    });
    const {mains_hz: hum} = this.finger;
    Object.assign(context, {strokeStyle: COMB, lineWidth: ratio});
    context.setLineDash([2 * ratio, 3 * ratio]);
    context.beginPath();
    for (let hz = hum; hum && hz < this.nyquist; hz += hum) {
      context.moveTo(xOf(hz), top);
      context.lineTo(xOf(hz), top + height);
    }
    context.stroke();
    context.restore();
  }

  describe() {
    const {channels, passband_hz: [low, high]} = this.finger, {now} = this;
    const rest = this.rest ? ', with the one at rest behind it' : '';
    const strongest = now && `strongest at ${rounded((this.strongest() + 1) * now.step)} Hz`;
    const lead = `Spectrum of ${channels[this.channel - 1]}${rest}`;
    const band = `pass-band ${low} to ${high || 'all above'} Hz`;
    update(this.root, {ariaLabel: [lead, band, strongest ?? 'too few samples yet'].join('; ')});
  }

  // Keys read the values at a frequency as the pointer does, beginning with the strongest one.
  onKey(event) {
    const step = STEPS[event.key];
    if (!step || isShortcut(event) || !this.now || !this.plot) return;
    event.preventDefault();
    const i = this.keyed === null ? this.strongest() : this.inside(this.keyed + step);
    this.key(i);
    this.plot.setCursor({left: this.plot.valToPos((i + 1) * this.now.step, 'x'), top: 0});
    write(this.readout, this.wordsAt(i));
  }

  // The number of the frequency that keys have chosen; null: the pointer chooses.
  key(i) {
    this.keyed = i;
    this.readout.ariaLive = i === null ? 'off' : 'polite';
  }

  inside(i) {
    return clamp(i, 0, this.now.density.length - 1);
  }

  restAt(hz) {
    return this.rest?.density[Math.round(hz / this.rest.step) - 1];
  }

  strongest() {
    return this.now.density.indexOf(Math.max(...this.now.density));
  }

  readOut() {
    // A value chosen by keys stays until the next key, as a screen reader reads it aloud.
    if (this.keyed !== null) return;
    const {now, plot} = this, {left} = plot.cursor;
    const i = now && Math.round(plot.posToVal(left, 'x') / now.step) - 1;
    write(this.readout, left < 0 || !now ? '\u00a0' : this.wordsAt(this.inside(i)));
  }

  wordsAt(i) {
    const {step, density: {[i]: db}} = this.now, hz = (i + 1) * step, rest = this.restAt(hz);
    const words = [`${rounded(hz)} Hz`, `${db.toFixed(1)} dB`];
    if (rest !== undefined) {
      words.push(`at rest ${rest.toFixed(1)} dB`, `${(db - rest).toFixed(1)} dB above`);
    }
    return words.join(' \u00b7 ');
  }
}
