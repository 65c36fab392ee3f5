// The picture of a recording: its signal, and its labels, each change of which is kept at once.

import {Slider, partsOf, write} from './elements.js';

// A step by keys, the shortest stretch that is seen, and the least range of the signal.
const STEP_S = 0.01, LEAST_S = 0.5, LEAST_DB = 6;
const CURVES = {loudest: [1, '#6a7986'], median: [2, '#0b5a8c']};
const ZOOMS = {'+': 2, '=': 2, '-': 0.5, Home: 0};
// Traces are asked for one after the other, as many wait at once when a page opens.
let turn = Promise.resolve();
const percent = (share) => `${Number((100 * share).toPrecision(2))} %`;

// The loudest and the median channel in dB over the label, a strip of the level, and the decision.
export class RecordingTrace {
  // request(type, content): asks about this recording; resolves with the answer.
  constructor(name, request) {
    Object.assign(this, {name, request, factor: 1, said: '', pairs: [], ends: []});
    const {root, canvas, hint, buttons, snap, undo, ...rest} = partsOf('recording-trace');
    Object.assign(this, {root, canvas, words: hint, edit: buttons});
    Object.assign(this, {frame: rest['trace-frame'], picture: rest.trace});
    canvas.ariaLabel = `Signal of ${name}`;
    Object.assign(snap, {ariaLabel: `Snap ${name}`, onclick: () => this.ask('snap')});
    Object.assign(undo, {ariaLabel: `Undo ${name}`, onclick: () => this.ask('undo_label')});
    listen(this.frame, 'scroll', () => this.draw());
    listen(this.frame, 'wheel', (event) => this.onWheel(event), {passive: false});
    listen(this.frame, 'keydown', (event) => this.onKey(event));
    new ResizeObserver(() => this.draw()).observe(this.picture);
  }

  async load() {
    this.loaded = true;
    const trace = await (turn = turn.then(() => this.request('trace')));
    if (trace.refusal) return write(this.words, `Not shown: ${trace.refusal}`);
    this.trace = trace;
    this.label(trace.slip_s);
  }

  // Show these intervals as the label; the same ends keep the focus.
  label(pairs) {
    this.pairs = pairs;
    if (this.ends.length !== 2 * pairs.length) {
      for (const end of this.ends) end.close();
      this.ends = pairs.flat().map((_, i) => this.handle(i));
      this.picture.append(...this.ends.map(({root}) => root));
    }
    this.allow(this.allowed);
    this.describe();
    this.draw();
  }

  handle(i) {
    const inside = (s) => {
      const ends = [-STEP_S, ...this.pairs.flat(), this.trace.duration_s + STEP_S];
      return clamp(s, ends[i] + STEP_S, ends[i + 2] - STEP_S);
    };
    return new Slider({
      name: `${i % 2 ? 'End' : 'Start'} of the slip in ${this.name}`,
      words: (s) => `${s.toFixed(2)} s`,
      valueOf: (x) => inside(x * this.pixel_s), step: (s, steps) => inside(s + steps * STEP_S),
      onMove: () => this.draw(),
      onSet: (s) => {
        const moved = this.pairs.with(i >> 1, this.pairs[i >> 1].with(i % 2, s));
        return this.ask('label', {slip_s: moved, pixel_s: this.pixel_s});
      },
    });
  }

  allow(allowed) {
    this.allowed = allowed;
    for (const end of this.ends) end.allow(allowed);
    this.edit.hidden = !allowed;
  }

  get pixel_s() {
    return this.trace.duration_s / this.picture.clientWidth;
  }

  async ask(type, content = {slip_s: this.pairs}) {
    const {refusal, said} = await this.request(type, content);
    if (refusal) return;
    this.said = said ? `Saved: ${said}` : 'Saved';
    await this.load();
  }

  // Say in how much of the slip, and of the rest, the detector is ON.
  describe() {
    const {coverage, false_time_percent: rest} = this.trace, on = [];
    const without = this.pairs.length ? 'rest' : this.name.split('_')[0];
    if (coverage !== null) on.push(`${percent(coverage)} of the slip`);
    if (rest !== null) on.push(`${percent(rest / 100)} of the ${without}`);
    const words = on.length ? `ON for ${on.join(', ')}` : 'Too short to say';
    write(this.words, [words, this.said].filter(Boolean).join('. '));
  }

  // Show a stretch shorter by this factor, by 0 all; what is x pixels from the left stays there.
  zoom(by, x = this.frame.clientWidth / 2) {
    const {frame, picture, trace} = this, share = (frame.scrollLeft + x) / picture.clientWidth;
    this.factor = Math.max(1, Math.min(this.factor * by, trace.duration_s / LEAST_S));
    picture.style.width = `${100 * this.factor}%`;
    frame.scrollLeft = share * picture.clientWidth - x;
  }

  // Over a small picture the wheel scrolls the page. Pinching a touchpad is a wheel with Ctrl.
  onWheel(event) {
    const {deltaX, deltaY, ctrlKey, clientX} = event, {left} = this.frame.getBoundingClientRect();
    const meant = ctrlKey || this.root.matches('#played, :focus-within');
    if (!meant || Math.abs(deltaX) > Math.abs(deltaY)) return;
    event.preventDefault();
    this.zoom(Math.exp(deltaY * (ctrlKey ? -0.01 : -0.002)), clientX - left);
  }

  onKey(event) {
    if (!(event.key in ZOOMS) || isShortcut(event)) return;
    event.preventDefault();
    this.zoom(ZOOMS[event.key]);
  }

  draw() {
    const {trace, canvas, frame: {scrollLeft}} = this;
    if (!trace || !canvas.clientWidth) return;
    const {context, width, height} = fitted(canvas), {pixel_s: pixel} = this, {bin_s: bin} = trace;
    const xOf = (s) => s / pixel - scrollLeft, ends = this.pairs.flat();
    const below = height - 2 * STRIP - 1;
    const seen = this.ends.map((end, i) => end.show(ends[i], 0, trace.duration_s));
    this.ends.forEach((end, i) => end.place(seen[i] / pixel));
    bars(context, xOf, seen, 0, height, TRUTH);
    bars(context, xOf, [trace.read_s, trace.duration_s], 0, height, HATCHING);
    bars(context, xOf, trace.on_s.flat(), height - STRIP, STRIP, ON);
    const first = Math.max(0, Math.floor(scrollLeft * pixel / bin) - 1);
    const stop = Math.min(trace.level.length, Math.ceil((scrollLeft + width) * pixel / bin) + 1);
    const color = (i) => shade(8 * (trace.level[i] - 1));
    paintRuns(context, below, STRIP, first, stop, color, (i) => xOf(i * bin));
    const rest = trace.rest_db, range = rangeOf(trace.loudest.slice(first, stop));
    const most = Math.max(range?.[1] ?? rest, rest + LEAST_DB);
    for (const [curve, [lineWidth, strokeStyle]] of Object.entries(CURVES)) {
      const values = trace[curve];
      Object.assign(context, {lineWidth, strokeStyle}).beginPath();
      for (let i = first; i < stop; i++) {
        if (values[i] === null) continue;
        const y = below - 2 - Math.max(0, values[i] - rest) / (most - rest) * (below - 4);
        context[values[i - 1] == null ? 'moveTo' : 'lineTo'](xOf((i + 0.5) * bin), y);
      }
      context.stroke();
    }
    Object.assign(context, {font: `11px ${FONT}`, fillStyle: INK});
    const scale = height > 60 && rest !== null ? [[most, 11], [rest, below - 3]] : [];
    for (const [db, y] of scale) context.fillText(`${Math.round(db)} dB`, 3, y);
  }
}
