// The recording that slip_view --bag plays: its trace, the place in it, and its labels.

import {holdable, pageKey, write} from './elements.js';
import {RecordingTrace} from './recording_trace.js';

// A shorter move of the pointer is a click, a shorter slip a mistake.
const DRAG_PX = 4, LEAST_S = 0.02;
const part = (name) => element(`bag-${name}`);

export class Played extends RecordingTrace {
  constructor(connection) {
    super('recording', (type, content) => connection.request(`bag_${type}`, content));
    Object.assign(this, {line: build('div.play-head'), band: build('div.new-label'), held: null});
    part('edit').append(...this.edit.children);
    Object.assign(this, {root: element('played'), edit: part('edit')});
    this.picture.append(this.band, this.line);
    this.frame.tabIndex = 0;
    this.root.append(this.frame, part('place'), this.words);
    connection.on('bag', (state) => this.show(state));
    connection.on('fingers', ({read_only: readOnly}) => this.allow(!readOnly));
    const playFrom = ({target}) => this.ask('play', {[target.name]: Number(target.value)});
    listen('bag-play', 'click', () => this.ask('play', {playing: !this.state.playing}));
    for (const id of ['bag-place', 'bag-speed']) listen(id, 'change', playFrom);
    listen('bag-shorter', 'click', () => this.zoom(2));
    listen('bag-longer', 'click', () => this.zoom(0.5));
    listen('bag-remove', 'click', () => (
      this.ask('label', {slip_s: this.pairs.filter((pair) => !this.isHere(pair))})));
    const press = () => this.press(true), release = () => this.press(false);
    holdable(part('hold'), {press, release, isHeld: () => this.held !== null});
    listen(document, 'keydown keyup', (event) => {
      if (pageKey(event) === 'l' && !event.repeat) this.press(event.type === 'keydown');
    });
    const types = 'pointerdown pointermove pointerup pointercancel';
    listen(this.picture, types, (event) => this.onPointer(event));
  }

  // A click goes to a place; a drag is a label.
  onPointer({type, button: which, clientX, pointerId}) {
    const {left, width} = this.picture.getBoundingClientRect(), {drag} = this;
    const to = clamp((clientX - left) / width, 0, 1) * this.trace?.duration_s;
    if (type === 'pointermove') return drag && this.mark(drag.from, to);
    this.drag = type === 'pointerdown' && !which && this.trace ? {from: to, x: clientX} : null;
    this.mark();
    if (this.drag) this.picture.setPointerCapture(pointerId);
    if (!drag || type !== 'pointerup') return;
    if (Math.abs(clientX - drag.x) < DRAG_PX) this.ask('play', {to_s: to});
    else this.add(drag.from, to, this.pixel_s);
  }

  // Whether the key is held: the slip is between the places that were shown then.
  press(held) {
    if (!this.trace || !this.allowed || held === (this.held !== null)) return;
    const from = this.held, {at_s: to} = this.state;
    this.held = held ? to : null;
    this.mark();
    if (!held && to - from >= LEAST_S) this.add(from, to);
  }

  show(state) {
    const {at_s: at, duration_s: end, reading} = state, {frame} = this;
    const differs = (part) => String(state[part]) !== String(this.state?.[part]);
    const changed = ['slip_s', 'changes', 'reading'].some(differs);
    this.state = state;
    this.root.hidden = false;
    write('bag-play', state.playing ? 'Stop' : 'Play');
    part('speed').value = state.speed;
    const place = `${at.toFixed(1)} of ${end.toFixed(1)}\u00a0s of ${state.name}`;
    write('bag-where', reading ? `${place}: ${reading}` : place);
    part('place').max = end;
    if (!part('place').matches(':active')) part('place').value = at;
    if (changed) this.load();
    if (!this.trace) return;
    if (changed) this.label(state.slip_s);
    part('remove').disabled = !this.pairs.some((pair) => this.isHere(pair));
    this.line.style.left = `${100 * at / this.trace.duration_s}%`;
    if (this.held !== null) this.mark(this.held, at);
    const x = at / this.pixel_s - frame.scrollLeft, seen = x >= 0 && x <= frame.clientWidth;
    if (state.playing && !seen) frame.scrollLeft += x - frame.clientWidth / 8;
  }

  isHere([from, to]) {
    return from <= this.state.at_s && this.state.at_s < to;
  }

  // Show what is to become a label; without ends: nothing.
  mark(from = 0, to = from) {
    const percent = (seconds) => `${100 * seconds / this.trace?.duration_s}%`;
    const left = percent(Math.min(from, to)), width = percent(Math.abs(to - from));
    Object.assign(this.band.style, {left, width});
  }

  // Add a slip, joined with those that it meets; pixel_s is there if it was set by eye.
  add(from, to, pixel_s) {
    const meets = ([start, end]) => start <= Math.max(from, to) && end >= Math.min(from, to);
    const joined = rangeOf([from, to, ...this.pairs.filter(meets).flat()]);
    const slip_s = [...this.pairs.filter((pair) => !meets(pair)), joined];
    if (this.allowed) this.ask('label', {slip_s, pixel_s});
  }

  // Ask for a change, which comes as news to all pages.
  async ask(type, content) {
    const {refusal, said} = await this.request(type, content);
    this.said = refusal ? `Refused: ${refusal}` : said ?? '';
    if (this.trace && this.said) this.label(this.state.slip_s);
  }

  describe() {
    super.describe();
    const {words, pairs, state: {labels}} = this;
    write(words, `Labels: ${pairs.length}, in ${labels}. ${words.textContent}`);
  }
}
