// The spectrum of one channel, the one at rest behind it, and the chain's bands with edges to drag.

import {Slider, button, heightFor, rounded, steady} from './elements.js';

const AXIS_WIDTH = 40, AXIS_DEPTH = 24, LABEL_SIZE = 18, RIGHT = 16, TOP = 8, HEIGHT = {least: 240, most: 560};
const NOW = '#0072b2', REST_FILL = 'rgba(90, 102, 112, 0.3)', REST = '#66717a', PASS = '#e4f1e9', STOP = '#f3e3da', COMB = '#7b2d6b';
// An upper edge above this share of half the sample rate means none: the band-pass is a high-pass.
// Below LEAST_HZ, or that share of half the sample rate, round-off would ruin the filter.
const OPEN_SHARE = 0.98, LEAST_HZ = 0.1, LEAST_SHARE = 2e-4;
const STEPS = {ArrowLeft: -1, ArrowRight: 1, PageUp: 20, PageDown: -20};

export class SpectrumPanel {
  constructor({onView, onSet}) {
    Object.assign(this, {onView, onSet});
    this.channel = null;
    this.shown = false;
    this.lines = new Map();
    this.keyed = null;
    this.range = [-100, 0];
    this.choice = element('spectrum-channel');
    this.mains = element('mains');
    this.root = element('spectrum-plot');
    this.frame = element('spectrum-frame');
    this.readout = element('spectrum-readout');
    this.choice.addEventListener('change', () => this.choose(Number(this.choice.value)));
    this.mains.addEventListener('change', async () => {
      const {refusal} = await this.onSet({mains_hz: Number(this.mains.value)});
      if (refusal) this.updateBands();
    });
    element('add-stopband').addEventListener('click', () => this.onSet({stopbands_hz: [...this.finger.stopbands_hz, this.room()].flat()}));
    this.root.addEventListener('keydown', (event) => this.onKey(event));
    for (const kind of ['blur', 'pointermove']) this.root.addEventListener(kind, () => this.key(null));
    new ResizeObserver(() => this.layOut()).observe(this.frame);
  }

  open(shown) {
    this.shown = shown;
    this.ask();
    if (shown) this.layOut();
  }

  show(finger) {
    const other = finger.name !== this.finger?.name || String(finger.channels) !== String(this.finger.channels);
    Object.assign(this, {finger, nyquist: finger.sample_rate_hz / 2});
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
    this.mains.disabled = element('keep-rest').disabled = !allowed;
    if (this.finger) this.updateBands();
  }

  choose(channel) {
    this.channel = this.choice.value = channel;
    this.ask();
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

  // The edges that can be dragged, each with its limits and why it stops there, and what it sets.
  edges() {
    const {passband_hz: [from, to], stopbands_hz: stops, activity_hz: [active = 0]} = this.finger;
    const {nyquist} = this;
    const edge = (name, short, value, [least, low], [most, high], values, open) => (
      {name, short, value, least, most, why: [low, high], values, open});
    const moved = (i, stop) => ({stopbands_hz: stops.with(i, stop).flat()});
    const lowest = [Math.max(LEAST_HZ, LEAST_SHARE * nyquist), 'lowest'], highest = [nyquist * 0.999, 'half the rate'];
    const none = (hz) => [hz, 'no band left'], first = active > lowest[0] ? [active, 'activity is below'] : lowest;
    return [
      edge('Pass-band, low edge', 'pass from', from, first, none((to || nyquist) * 0.95), (hz) => ({passband_hz: [hz, to]})),
      edge('Pass-band, high edge', 'pass to', to, none(from * 1.05), highest,
        (hz) => ({passband_hz: [from, hz]}), true),
      ...stops.flatMap(([low, high], i) => [
        edge(`Stop-band ${i + 1}, low edge`, `stop ${i + 1} from`, low, lowest, none(high * 0.95), (hz) => moved(i, [hz, high])),
        edge(`Stop-band ${i + 1}, high edge`, `stop ${i + 1} to`, high, none(low * 1.05), highest, (hz) => moved(i, [low, hz])),
      ]),
    ];
  }

  updateBands() {
    const edges = this.edges(), names = String(edges.map(({name}) => name));
    if (names !== String([...this.lines.keys()])) {
      for (const line of this.lines.values()) line.close();
      this.lines = new Map(edges.map((edge) => [edge.name, this.lineOf(edge)]));
      edges.forEach(({name}, row) => this.lines.get(name).root.style.setProperty('--row', row));
    }
    for (const line of this.lines.values()) line.allow(this.allowed);
    const {stopbands_hz: stops, mains_hz: mains} = this.finger;
    element('removers').replaceChildren(...stops.map(([low, high], i) => button(
      `Remove stop-band ${i + 1}: ${low} to ${high} Hz`, () => this.onSet({stopbands_hz: stops.toSpliced(i, 1).flat()}), {disabled: !this.allowed})));
    element('add-stopband').disabled = !this.allowed || !this.room();
    if (![...this.mains.options].some(({value}) => Number(value) === mains)) this.mains.append(new Option(`mains ${mains} Hz`, mains));
    this.mains.value = mains;
  }

  // The line at an edge. open: at the end of the axis it means that there is no edge.
  lineOf({name, short, open}) {
    const edge = () => this.edges().find((each) => each.name === name);
    const inside = (hz) => {
      const {least, most, why: [low, high]} = edge(), within = Math.min(Math.max(hz, least), most);
      line.why = hz < least ? `: ${low}` : hz > most ? `: ${high}` : '';
      if (open && hz >= this.nyquist * OPEN_SHARE) return 0;
      const value = rounded(within);
      return value < least || value > most ? Number(within.toPrecision(4)) : value;
    };
    const line = new Slider({
      name, vertical: false, valueOf: (x) => inside(this.plot.posToVal(x - this.plot.over.offsetLeft, 'x')),
      words: (hz) => (open && !hz ? `${short} all above` : `${short} ${hz} Hz${line.moving ? line.why : ''}`),
      step: (hz, steps) => inside((hz || this.nyquist) * 1.02 ** steps),
      onMove: () => this.draw(), onSet: (hz) => this.onSet(edge().values(hz)),
    });
    line.root.classList.add(name.split(/[ ,]/)[0].toLowerCase());
    this.frame.append(line.root);
    return line;
  }

  // Where one more stop-band has room: above the pass-band, else in it; undefined: nowhere.
  room() {
    const {passband_hz: [low, high], stopbands_hz: stops} = this.finger, most = rounded(this.nyquist * 0.98);
    const upwards = (from) => {
      for (const [begin, end] of stops.toSorted(([a], [b]) => a - b)) if (begin < from * 1.1 && end > from) from = end;
      return [rounded(from), Math.min(rounded(from * 1.25), most, ...stops.flat().filter((edge) => edge > from))];
    };
    return [high || this.nyquist / 2, low].map(upwards).find(([begin, end]) => end > begin * 1.02);
  }

  layOut() {
    const width = this.frame.clientWidth;
    if (!this.finger || !width) return;
    const height = Math.max(HEIGHT.least, Math.min(HEIGHT.most, heightFor(this.frame, 110)));
    this.frame.style.height = `${height}px`;
    this.plot ??= new uPlot(this.options(width, height), [[1], [null], [null]], this.root);
    if (this.plot.width !== width || this.plot.height !== height) this.plot.setSize({width, height});
    this.draw();
  }

  options(width, height) {
    const axis = {stroke: TEXT, font: '12px system-ui, sans-serif', grid: {stroke: GRID, width: 1}, ticks: {show: false}};
    const label = {labelSize: LABEL_SIZE, labelFont: axis.font};
    return {
      width, height, legend: {show: false}, padding: [TOP, RIGHT, 0, 0],
      scales: {x: {time: false, distr: 3, auto: false, range: () => [this.leastHz(), this.nyquist]}, y: {auto: false, range: () => this.range}},
      axes: [
        {...axis, ...label, size: AXIS_DEPTH, label: 'frequency, Hz', space: 24, filter: (_, splits) => splits,
          values: (_, splits) => splits.map((hz) => (hz === null || !/^[125]/.test(hz.toExponential()) ? '' : String(hz)))},
        {...axis, ...label, size: AXIS_WIDTH, label: 'dB of 1 V/\u221aHz'},
      ],
      series: [{}, {stroke: REST, fill: REST_FILL, fillTo: () => this.range[0], width: 1, dash: [5, 3], points: {show: false}}, {stroke: NOW, width: 1.6, points: {show: false}}],
      cursor: {y: false, points: {show: false}, drag: {x: false, y: false}, bind: {dblclick: () => null}},
      hooks: {
        drawClear: [(plot) => this.paintBands(plot)], setCursor: [(plot) => this.readOut(plot)],
      },
    };
  }

  leastHz() {
    return Math.min(this.now?.step ?? 0.5, ...this.finger.stopbands_hz.flat(), this.finger.passband_hz[0]);
  }

  draw() {
    if (!this.plot || !this.frame.clientWidth) return;
    // Both curves at the frequencies of the present spectrum.
    const {now, rest} = this, step = now?.step ?? 1, x = Array.from(now?.density ?? [null], (_, i) => (i + 1) * step);
    const shadow = x.map((hz) => rest?.density[Math.round(hz / rest.step) - 1] ?? null);
    if (now) {
      const values = [...now.density, ...(rest?.density ?? [])], most = Math.max(...values), least = Math.max(Math.min(...values), most - 120);
      this.range = steady(this.range, [10 * Math.floor(least / 10 - 0.3), 10 * Math.ceil(most / 10 + 0.3)], 0.6);
    }
    this.plot.batch(() => {
      this.plot.setData([x, shadow, now?.density ?? [null]], false);
      this.plot.setScale('x', {min: this.leastHz(), max: this.nyquist});
      this.plot.setScale('y', {min: this.range[0], max: this.range[1]});
    });
    const {over} = this.plot;
    for (const {name, value, least, most} of this.edges()) {
      const line = this.lines.get(name), shown = line.show(value, least, most);
      const pixel = this.plot.valToPos(shown || this.nyquist, 'x');
      line.place(over.offsetLeft + pixel);
      const {offsetWidth: wide} = line.label;
      line.root.classList.toggle('left', pixel > (name.includes('high') ? wide : over.clientWidth - wide));
    }
    this.describe();
  }

  paintBands(plot) {
    const {ctx: context, bbox: {left, top, width, height}} = plot, ratio = width / plot.over.clientWidth || 1;
    const xOf = (hz) => Math.min(Math.max(plot.valToPos(hz, 'x', true), left), left + width);
    const fill = (low, high, color) => {
      context.fillStyle = color;
      context.fillRect(xOf(low), top, xOf(high) - xOf(low), height);
    };
    // The values of the edges: those to which they are dragged, or the detector's.
    const [from, to, ...others] = this.edges().map(({name, value}) => this.lines.get(name)?.chosen ?? value);
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
    const name = this.finger.channels[this.channel - 1], {passband_hz: [low, high]} = this.finger;
    const words = `Spectrum of ${name}${this.rest ? ', with the one at rest behind it' : ''}; pass-band ${low} to ${high || 'all above'} Hz`
      + (this.now ? `; strongest at ${rounded((this.strongest() + 1) * this.now.step)} Hz` : '; too few samples yet');
    if (this.root.ariaLabel !== words) this.root.ariaLabel = words;
  }

  // Keys read the values at a frequency as the pointer does, beginning with the strongest one.
  onKey(event) {
    const step = STEPS[event.key];
    if (!step || event.ctrlKey || event.metaKey || event.altKey || !this.now || !this.plot) return;
    event.preventDefault();
    const i = this.keyed === null ? this.strongest() : Math.min(Math.max(this.keyed + step, 0), this.now.density.length - 1);
    this.key(i);
    this.plot.setCursor({left: this.plot.valToPos((i + 1) * this.now.step, 'x'), top: 0});
    this.readout.textContent = this.wordsAt(i);
  }

  // The number of the frequency, counted from 0, that keys have chosen; null: the pointer chooses.
  key(i) {
    this.keyed = i;
    this.readout.ariaLive = i === null ? 'off' : 'polite';
  }

  strongest() {
    return this.now.density.indexOf(Math.max(...this.now.density));
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
