// A line in a drawing that is dragged, or moved by keys; for screen readers it is a slider.

import {write} from './elements.js';

// A value moved by keys is set by Enter, or this time after the last key.
const KEYS_MS = 700;
// Longest time between the answer to a change and the message with the new value.
const SHOWN_MS = 500;
const STEPS = {ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: 10, PageDown: -10};

export class Slider {
  // vertical: whether the line is moved up and down, else to the left and right.
  // valueOf(pixel): the value at a pixel of the slider's parent. words(value): the label of a value.
  // step(value, steps): the value so many steps up or down. onMove(): called when the line has moved.
  // onSet(value): called when it is released; resolves when the change was answered.
  constructor({name, vertical, valueOf, words, step, onMove, onSet}) {
    Object.assign(this, {vertical, valueOf, words, step, onMove, onSet});
    const direction = vertical ? 'vertical' : 'horizontal';
    this.label = build('span.label');
    this.root = build(`div.slider.${direction}`, this.label, {role: 'slider', tabIndex: 0, ariaLabel: name, ariaOrientation: direction});
    // The value that the user has chosen, until the detector has it or has refused it; else null.
    this.chosen = null;
    this.drop();
    const on = (kind, act) => this.root.addEventListener(kind, act);
    on('pointerdown', (event) => this.grip(event));
    on('pointermove', (event) => this.gripped && this.move(this.valueAt(event)));
    on('pointerup', () => this.gripped && this.set());
    on('pointercancel', () => this.leave());
    on('keydown', (event) => this.onKey(event));
    on('blur', () => this.timer && this.set());
  }

  allow(allowed) {
    this.root.ariaDisabled = String(!allowed);
  }

  get moving() {
    return this.gripped || this.timer !== null;
  }

  // Show a value, unless the user has chosen another one; returns the one that is shown.
  show(value, least, most) {
    if (value !== this.value && !this.moving) this.chosen = null;
    this.value = value;
    const shown = this.chosen ?? value, words = this.words(shown);
    write(this.label, words);
    Object.assign(this.root, {ariaValueNow: `${shown}`, ariaValueMin: `${least}`, ariaValueMax: `${most}`, ariaValueText: words});
    return shown;
  }

  place(pixel) {
    this.root.style[this.vertical ? 'top' : 'left'] = `${pixel}px`;
  }

  valueAt({clientX, clientY}) {
    const box = this.root.parentElement.getBoundingClientRect();
    return this.valueOf(this.vertical ? clientY - box.top : clientX - box.left);
  }

  move(value) {
    this.chosen = value;
    this.onMove();
  }

  // The line stays where it was released until the detector reports its value.
  async set() {
    const {chosen} = this;
    this.drop();
    if (chosen === null) return;
    if (chosen !== this.value) await this.onSet(chosen);
    setTimeout(() => {
      if (this.chosen === chosen && !this.moving) this.leave();
    }, SHOWN_MS);
  }

  leave() {
    this.drop();
    this.chosen = null;
    this.onMove();
  }

  // Before the line shows another finger: set a value chosen by keys, abandon a drag.
  settle() {
    if (this.timer) this.set();
    this.leave();
  }

  close() {
    this.drop();
    this.root.remove();
  }

  drop() {
    clearTimeout(this.timer);
    this.gripped = false;
    this.timer = null;
  }

  grip(event) {
    if (event.button || this.root.ariaDisabled === 'true') return;
    event.preventDefault();
    event.stopPropagation();
    this.root.focus();
    this.root.setPointerCapture(event.pointerId);
    this.gripped = true;
  }

  onKey(event) {
    if (this.root.ariaDisabled === 'true' || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key in STEPS) {
      this.move(this.step(this.chosen ?? this.value, STEPS[event.key]));
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.set(), KEYS_MS);
    } else if (event.key === 'Enter') {
      this.set();
    } else if (event.key === 'Escape') {
      this.leave();
    } else {
      return;
    }
    event.preventDefault();
    event.stopPropagation();
  }
}

// A value with three significant digits, as it is set.
export const rounded = (value) => Number(value.toPrecision(3));
