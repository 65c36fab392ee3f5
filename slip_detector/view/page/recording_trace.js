// The picture of a recording, with its labels.

import {Slider, button, write} from './elements.js';

const STEP_S = 0.01, LEVEL = '#3d5a73';
// Traces are asked for one after the other, as many wait at once when a page opens.
let turn = Promise.resolve();
const percent = (share) => `${Number((100 * share).toPrecision(2))} %`;

// A recording as a small picture: the level, the intervals of its label, and of what the detector as it
// is would decide. The ends of the label can be dragged, snapped to where the signal changes, and saved.
export class RecordingTrace {
  // request(type, content): asks about this recording; resolves with the answer.
  constructor(name, request) {
    Object.assign(this, {name, request});
    this.canvas = build('canvas');
    this.picture = build('div.trace', this.canvas);
    this.words = build('p.hint');
    this.snap = button('Snap', () => this.ask('snap'), {title: 'Move the ends to where the power of the signal changes, if that is found within 0.7 s'});
    this.save = button('Save labels', () => this.ask('label'), {title: 'An end that was moved is right to 0.1 s, or a pixel; the others as before'});
    this.reset = button('Reset', () => this.move(this.saved));
    this.edit = build('span.buttons', this.snap, this.save, this.reset);
    this.root = build('div.recording-trace', this.picture, this.words, this.edit);
    this.ends = [];
    new ResizeObserver(() => this.draw()).observe(this.picture);
  }

  async load() {
    this.loaded = true;
    const trace = await (turn = turn.then(() => this.request('trace')));
    if (trace.refusal) return write(this.words, `Not shown: ${trace.refusal}`);
    this.trace = trace;
    this.saved = trace.slip_s.flat();
    // The same ends keep the focus.
    if (this.ends.length !== this.saved.length) {
      for (const end of this.ends) end.close();
      this.ends = this.saved.map((_, i) => this.handle(i));
      this.picture.append(...this.ends.map(({root}) => root));
    }
    this.move(this.saved);
    this.allow(this.allowed);
  }

  handle(i) {
    const {duration_s: end} = this.trace;
    // An end stays between its neighbours.
    const inside = (s) => Math.min(Math.max(s, (this.slip[i - 1] ?? -STEP_S) + STEP_S), (this.slip[i + 1] ?? end + STEP_S) - STEP_S);
    return new Slider({
      name: `${i % 2 ? 'End' : 'Start'} of the slip in ${this.name}`, words: (s) => `${s.toFixed(2)} s`,
      valueOf: (x) => inside(x / this.canvas.clientWidth * end), step: (s, steps) => inside(s + steps * STEP_S),
      onMove: () => this.draw(),
      onSet: (s) => this.move(this.slip.with(i, Number(s.toFixed(4)))),
    });
  }

  allow(allowed) {
    this.allowed = allowed;
    for (const end of this.ends) end.allow(allowed);
    this.edit.hidden = !allowed;
  }

  async ask(type) {
    const pairs = this.saved.flatMap((_, i) => (i % 2 ? [] : [this.slip.slice(i, i + 2)]));
    const answer = await this.request(type, {slip_s: pairs, pixel_s: this.trace.duration_s / this.canvas.clientWidth});
    if (!answer.refusal) await (type === 'snap' ? this.move(answer.slip_s.flat(), answer.said) : this.load());
  }

  move(slip, snapped) {
    this.slip = slip;
    const moved = slip.map((s, i) => s - this.saved[i]), changed = moved.some((by) => Math.abs(by) > 1e-6);
    this.save.disabled = this.reset.disabled = !changed;
    const {coverage, false_time_percent: rest} = this.trace, without = this.ends.length ? 'rest' : this.name.split('_')[0];
    const on = [coverage !== null && `${percent(coverage)} of the slip`, rest !== null && `${percent(rest / 100)} of the ${without}`].filter(Boolean);
    const by = moved.map((s, i) => `${i % 2 ? 'end' : 'start'} ${s < 0 ? '\u2212' : '+'}${Math.abs(s).toFixed(2)} s`);
    write(this.words, snapped ? `Not saved: ${snapped}` : changed ? `Moved, not saved: ${by.join(', ')}` : on.length ? `ON for ${on.join(', ')}` : 'Too short to say');
    this.draw();
  }

  draw() {
    const {trace, canvas} = this;
    if (!trace || !canvas.clientWidth) return;
    const {context, width, height} = fitted(canvas), room = {context, left: 0, right: width};
    const xOf = (s) => s / trace.duration_s * width;
    const shown = this.ends.map((end, i) => end.show(this.slip[i], 0, trace.duration_s));
    this.ends.forEach((end, i) => end.place(xOf(shown[i])));
    bars(room, xOf, shown, 0, height, TRUTH);
    bars(room, xOf, trace.on_s.flat(), height - STRIP, STRIP, ON);
    context.strokeStyle = LEVEL;
    context.beginPath();
    trace.level.forEach((level, i) => context.lineTo(xOf((i + 0.5) * trace.bin_s), (height - STRIP) * (1 - level / 2)));
    context.stroke();
  }
}
