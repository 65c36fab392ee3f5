// The spectrum of one channel, the one at rest behind it, and the chain's bands with edges to drag.

import {build, button} from './elements.js';
import {Slider, rounded} from './slider.js';

const AXIS_WIDTH = 40, AXIS_DEPTH = 24, LABEL_SIZE = 18, RIGHT = 16, TOP = 8, HEIGHT = {least: 220, most: 420};
const NOW = '#0072b2', REST_FILL = 'rgba(90, 102, 112, 0.3)', REST = '#66717a', PASS = '#e4f1e9', STOP = '#f3e3da', COMB = '#7b2d6b';
// An upper edge above this share of half the sample rate means none: the band-pass is a high-pass.
const OPEN_SHARE = 0.98;
const LEAST_HZ = 0.1;

export class SpectrumPanel {
  // panel: an empty element. onView(changes), onSet(values): as for Traces. onKeepRest(): the user wants
  // the present spectra kept as those at rest.
  constructor(panel, {onView, onSet, onKeepRest}) {
    Object.assign(this, {onView, onSet});
    this.channel = null;
    this.shown = false;
    this.lines = new Map();
    this.keyed = null;
    this.choice = build('select', {ariaLabel: 'Channel'});
    this.choice.addEventListener('change', () => this.choose(Number(this.choice.value)));
    const keep = button('Hold as rest', onKeepRest, {title: 'Keep the present spectrum of each channel as a shadow behind it'});
    this.more = button('Add stop-band', () => this.addStopband(), {title: 'One more stop-band above the pass-band'});
    this.mainsChoice = build('select', new Option('no mains', 0), {ariaLabel: 'Hum of the mains that is taken off'});
    this.mainsChoice.append(...[50, 60].map((hz) => new Option(`mains ${hz} Hz`, hz)));
    this.mainsChoice.addEventListener('change', () => this.onSet({mains_hz: Number(this.mainsChoice.value)}));
    const bar = build('div.trace-bar', build('span', 'Channel ', this.choice), keep, this.mainsChoice, this.more);
    this.root = build('div.spectrum-plot', {role: 'img', tabIndex: 0});
    this.root.addEventListener('keydown', (event) => this.onKey(event));
    for (const kind of ['blur', 'pointermove']) this.root.addEventListener(kind, () => this.keyed !== null && this.keyAt(null));
    this.frame = build('div.spectrum-frame', this.root);
    this.removers = build('p.removers');
    this.readout = build('p.readout', '\u00a0');
    panel.append(bar, this.frame, this.removers, this.readout);
    new ResizeObserver(() => this.layOut()).observe(this.frame);
  }

  // Note whether the panel is shown; if not, no spectrum is asked for.
  open(shown) {
    this.shown = shown;
    this.ask();
    if (shown) this.layOut();
  }

  show(finger) {
    const other = finger.name !== this.finger?.name || String(finger.channels) !== String(this.finger.channels);
    this.finger = finger;
    if (other) {
      this.now = this.rest = null;
      this.choice.replaceChildren(...finger.channels.map((name, c) => new Option(name, c + 1)));
      this.choose(Object.values(finger.groups)[0]?.[0] ?? 1);
    }
    this.updateBands();
    this.layOut();
  }

  allowChanges(allowed) {
    this.allowed = allowed;
    for (const control of [this.more, this.mainsChoice]) control.disabled = !allowed;
    for (const {root} of this.lines.values()) root.ariaDisabled = String(!allowed);
  }

  choose(channel) {
    this.channel = channel;
    this.choice.value = channel;
    this.ask();
  }

  // End changes of this finger before another one is shown.
  settle() {
    for (const line of this.lines.values()) line.settle();
  }

  ask() {
    this.onView({spectrum: this.shown ? this.channel : null});
  }

  take({name, channel, step_hz: step, rest_step_hz: restStep}, {spectrum, rest}) {
    if (name !== this.finger?.name || channel !== this.channel) return;
    this.now = spectrum ? {step, density: Array.from(spectrum)} : null;
    this.rest = rest ? {step: restStep, density: Array.from(rest)} : null;
    this.draw();
  }

  // ---- the bands

  get nyquist() {
    return this.finger.sample_rate_hz / 2;
  }

  // The edges that can be dragged: name, value and limits of each, and the parameters for a new value.
  edges() {
    const {passband_hz: pass, stopbands_hz: stops, mains_hz: mains} = this.finger, {nyquist} = this;
    const low = {name: 'Pass-band, low edge', short: 'pass from', value: pass[0], least: LEAST_HZ, most: (pass[1] || nyquist) * 0.95,
      values: (hz) => ({passband_hz: [hz, pass[1]]})};
    const high = {name: 'Pass-band, high edge', short: 'pass to', value: pass[1], least: pass[0] * 1.05, most: nyquist, open: true,
      values: (hz) => ({passband_hz: [pass[0], hz]})};
    const stopEdges = stops.flatMap((stop, i) => stop.map((hz, side) => ({
      name: `Stop-band ${i + 1}, ${side ? 'high' : 'low'} edge`, short: `stop ${i + 1} ${side ? 'to' : 'from'}`, value: hz,
      least: side ? stop[0] * 1.05 : LEAST_HZ, most: side ? nyquist * 0.999 : stop[1] * 0.95,
      values: (moved) => ({stopbands_hz: stops.flatMap((other, k) => (
        k !== i ? other : side ? [other[0], moved] : [moved, other[1]]))}),
    })));
    const comb = mains ? [{name: 'Mains', short: 'mains', value: mains, least: 1, most: nyquist, whole: true,
      values: (hz) => ({mains_hz: hz})}] : [];
    return [low, high, ...stopEdges, ...comb];
  }

  updateBands() {
    const edges = this.edges(), names = edges.map(({name}) => name);
    for (const [name, line] of this.lines) {
      if (names.includes(name)) continue;
      line.close();
      this.lines.delete(name);
    }
    for (const {name, short, open, whole} of edges) {
      if (this.lines.has(name)) continue;
      const edge = () => this.edges().find((each) => each.name === name);
      const inside = (hz) => {
        const {least, most} = edge();
        if (open && hz >= this.nyquist * OPEN_SHARE) return 0;
        const within = Math.min(Math.max(hz, least), most);
        return whole ? Math.round(within) : rounded(within);
      };
      const line = new Slider({
        name, vertical: false, words: (hz) => (open && !hz ? `${short} all above` : `${short} ${hz} Hz`),
        valueOf: (x) => inside(this.hzAt(x)),
        step: (hz, steps) => inside(whole ? hz + steps : (hz || this.nyquist) * 1.02 ** steps),
        onMove: () => this.draw(), onSet: (hz) => this.onSet(edge().values(hz)),
      });
      line.root.classList.add(name.split(/[ ,]/)[0].toLowerCase(), name.includes('high') ? 'high' : 'low');
      line.root.ariaDisabled = String(!this.allowed);
      this.lines.set(name, line);
      this.frame.append(line.root);
    }
    const {stopbands_hz: stops, mains_hz: mains} = this.finger;
    this.removers.replaceChildren(...stops.map(([low, high], i) => {
      const others = stops.filter((_, k) => k !== i).flat();
      return button(`Remove stop-band ${i + 1}: ${low} to ${high} Hz`, () => this.onSet({stopbands_hz: others}), {disabled: !this.allowed});
    }));
    if (![...this.mainsChoice.options].some(({value}) => Number(value) === mains)) {
      this.mainsChoice.append(new Option(`mains ${mains} Hz`, mains));
    }
    this.mainsChoice.value = mains;
  }

  addStopband() {
    const {passband_hz: [, high], stopbands_hz: stops} = this.finger, {nyquist} = this;
    const taken = Math.max(high, ...stops.flat().filter((hz) => hz < nyquist * 0.9));
    const from = taken < nyquist * 0.8 ? taken : high || nyquist / 2;
    this.onSet({stopbands_hz: [...stops.flat(), rounded(from), rounded(Math.min(from * 1.25, nyquist * 0.98))]});
  }

  // The value of an edge: the one it is dragged to, or the detector's.
  at(name, value) {
    return this.lines.get(name)?.chosen ?? value;
  }

  // ---- drawing

  layOut() {
    const width = this.frame.clientWidth;
    if (!this.finger || !width) return;
    const top = this.frame.getBoundingClientRect().top + window.scrollY;
    const height = Math.max(HEIGHT.least, Math.min(HEIGHT.most, window.innerHeight - top - 110));
    if (this.plot && this.rate !== this.finger.sample_rate_hz) {
      this.plot.destroy();
      this.plot = null;
    }
    this.rate = this.finger.sample_rate_hz;
    this.height = height;
    this.frame.style.height = `${height}px`;
    if (this.plot && (this.plot.width !== width || this.plot.height !== height)) this.plot.setSize({width, height});
    this.plot ??= new uPlot(this.options(width, height), [[1], [null], [null]], this.root);
    this.draw();
  }

  options(width, height) {
    const axis = {stroke: TEXT, font: '12px system-ui, sans-serif', grid: {stroke: GRID, width: 1}, ticks: {show: false}};
    return {
      width, height, legend: {show: false}, padding: [TOP, RIGHT, 0, 0],
      scales: {x: {time: false, distr: 3, auto: false, range: () => [this.leastHz(), this.nyquist]}, y: {auto: false, range: () => this.range ?? [-100, 0]}},
      axes: [
        {...axis, size: AXIS_DEPTH, label: 'frequency, Hz', labelSize: LABEL_SIZE, labelFont: axis.font,
          space: 24, filter: (_, splits) => splits,
          values: (_, splits) => splits.map((hz) => (hz === null || !/^[125]/.test(hz.toExponential()) ? '' : String(hz)))},
        {...axis, size: AXIS_WIDTH, label: 'dB of 1 V/\u221aHz', labelSize: LABEL_SIZE, labelFont: axis.font},
      ],
      series: [{}, {stroke: REST, fill: REST_FILL, fillTo: () => this.range[0], width: 1, dash: [5, 3], points: {show: false}}, {stroke: NOW, width: 1.6, points: {show: false}}],
      cursor: {y: false, points: {show: false}, drag: {x: false, y: false}, bind: {dblclick: () => null}},
      hooks: {
        drawClear: [(plot) => this.paintBands(plot)],
        setCursor: [(plot) => this.readOut(plot)],
      },
    };
  }

  leastHz() {
    const step = this.now?.step ?? 0.5;
    return Math.min(step, ...this.finger.stopbands_hz.flat(), this.finger.passband_hz[0]);
  }

  draw() {
    if (!this.plot || !this.frame.clientWidth) return;
    // Both curves at the frequencies of the present spectrum.
    const {now, rest} = this, step = now?.step ?? rest?.step ?? 1, n = (now ?? rest)?.density.length ?? 1;
    const x = Array.from({length: n}, (_, i) => (i + 1) * step);
    const shadow = rest ? x.map((hz) => rest.density[Math.round(hz / rest.step) - 1] ?? null) : x.map(() => null);
    this.follow([...(now?.density ?? []), ...(rest?.density ?? [])]);
    this.plot.batch(() => {
      this.plot.setData([x, shadow, now?.density ?? x.map(() => null)], false);
      this.plot.setScale('x', {min: this.leastHz(), max: this.nyquist});
      this.plot.setScale('y', {min: this.range[0], max: this.range[1]});
    });
    const {over} = this.plot;
    this.frame.style.setProperty('--plot-top', `${over.offsetTop}px`);
    this.frame.style.setProperty('--plot-height', `${over.clientHeight}px`);
    for (const {name, value, least, most} of this.edges()) {
      const line = this.lines.get(name), shown = line.show(value, least, most);
      line.place(over.offsetLeft + this.plot.valToPos(shown || this.nyquist, 'x'));
    }
    this.describe();
  }

  // The range of the axis, in whole tens of decibels: it changes only if values leave it, or if it is
  // far too large.
  follow(values) {
    if (!values.length) {
      this.range ??= [-100, 0];
      return;
    }
    const most = values.reduce((a, b) => Math.max(a, b)), least = Math.max(values.reduce((a, b) => Math.min(a, b)), most - 120);
    const wanted = [10 * Math.floor(least / 10 - 0.3), 10 * Math.ceil(most / 10 + 0.3)];
    const fits = this.range && wanted[0] >= this.range[0] && wanted[1] <= this.range[1]
      && this.range[1] - this.range[0] <= wanted[1] - wanted[0] + 30;
    if (!fits) this.range = wanted;
  }

  hzAt(x) {
    return this.plot.posToVal(x - this.plot.over.offsetLeft, 'x');
  }

  paintBands(plot) {
    const {ctx: context, bbox: {left, top, width, height}} = plot, ratio = width / plot.over.clientWidth || 1;
    const xOf = (hz) => Math.min(Math.max(plot.valToPos(hz, 'x', true), left), left + width);
    const band = (low, high, color) => {
      context.fillStyle = color;
      context.fillRect(xOf(low), top, xOf(high) - xOf(low), height);
    };
    const {passband_hz: [low, high], stopbands_hz: stops, mains_hz: mains} = this.finger;
    context.save();
    band(this.at('Pass-band, low edge', low), this.at('Pass-band, high edge', high) || this.nyquist, PASS);
    stops.forEach((stop, i) => {
      const [from, to] = stop.map((hz, side) => this.at(`Stop-band ${i + 1}, ${side ? 'high' : 'low'} edge`, hz));
      band(from, to, STOP);
      // Hatched, too: not by colour alone.
      context.save();
      context.beginPath();
      context.rect(xOf(from), top, xOf(to) - xOf(from), height);
      context.clip();
      context.strokeStyle = '#c98f6d';
      context.lineWidth = ratio;
      context.beginPath();
      for (let x = xOf(from) - height; x < xOf(to); x += 12 * ratio) {
        context.moveTo(x, top + height);
        context.lineTo(x + height, top);
      }
      context.stroke();
      context.restore();
    });
    const hum = this.at('Mains', mains);
    if (hum) {
      context.strokeStyle = COMB;
      context.lineWidth = ratio;
      context.setLineDash([2 * ratio, 3 * ratio]);
      context.beginPath();
      for (let hz = hum; hz < this.nyquist; hz += hum) {
        context.moveTo(xOf(hz), top);
        context.lineTo(xOf(hz), top + height);
      }
      context.stroke();
    }
    context.restore();
  }

  // ---- words

  describe() {
    const name = this.finger.channels[this.channel - 1], {passband_hz: [low, high]} = this.finger;
    const words = `Spectrum of ${name}${this.rest ? ', with the one at rest behind it' : ''}; pass-band ${low} to ${high || 'all above'} Hz`
      + (this.now ? `; strongest at ${rounded((this.strongest() + 1) * this.now.step)} Hz` : '; too few samples yet');
    if (this.root.ariaLabel !== words && !(Date.now() - this.describedAt < 1000)) {
      this.root.ariaLabel = words;
      this.describedAt = Date.now();
    }
  }

  // Keys read the values at a frequency as the pointer does, beginning with the strongest one.
  onKey(event) {
    const step = {ArrowLeft: -1, ArrowRight: 1, PageUp: 20, PageDown: -20}[event.key];
    if (!step || event.ctrlKey || event.metaKey || event.altKey || !this.now || !this.plot) return;
    event.preventDefault();
    const i = this.keyed === null ? this.strongest() : this.keyed + step;
    this.keyAt(Math.min(Math.max(i, 0), this.now.density.length - 1));
    this.readout.textContent = this.wordsAt(this.keyed);
  }

  // Put the cursor on frequency i, counted from 0; null: remove it.
  keyAt(i) {
    this.keyed = i;
    this.readout.ariaLive = i === null ? 'off' : 'polite';
    this.plot?.setCursor(i === null ? {left: -10, top: -10} : {left: this.plot.valToPos((i + 1) * this.now.step, 'x'), top: 0});
  }

  strongest() {
    return this.now.density.reduce((best, value, i, all) => (value > all[best] ? i : best), 0);
  }

  readOut(plot) {
    // A value chosen by keys stays until the next key, as a screen reader reads it aloud.
    if (this.keyed !== null) return;
    const {left} = plot.cursor, i = Math.round(plot.posToVal(left, 'x') / (this.now?.step ?? 1)) - 1;
    this.readout.textContent = left < 0 || !this.now ? '\u00a0' : this.wordsAt(Math.min(Math.max(i, 0), this.now.density.length - 1));
  }

  wordsAt(i) {
    const hz = (i + 1) * this.now.step, words = [`${rounded(hz)} Hz`, `${this.now.density[i].toFixed(1)} dB`];
    const rest = this.rest?.density[Math.round(hz / this.rest.step) - 1];
    if (rest !== undefined) words.push(`at rest ${rest.toFixed(1)} dB`, `${(this.now.density[i] - rest).toFixed(1)} dB above`);
    return words.join(' \u00b7 ');
  }
}
