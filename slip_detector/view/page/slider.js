// A line in a drawing that is dragged, or moved by keys; for screen readers it is a slider.

import {write} from './elements.js';

// A value moved by keys is set by Enter, or this time after the last key.
const KEYS_MS = 700;
// Longest time between the answer to a change and the message with the new value.
const ANSWERED_MS = 500;
const STEPS = {
  ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: 10, PageDown: -10,
};

export class Slider {
  // vertical: whether the line is moved up and down, else to the left and right.
  // valueOf(pixel): the value at a pixel of the slider's parent. words(value): a value's label.
  // step(value, steps): the value so many steps up or down. onMove(): called when the line has
  // moved. onSet(value): called when it is released; resolves when the change was answered.
  constructor({name, vertical, ...calls}) {
    Object.assign(this, {vertical, ...calls});
    const direction = vertical ? 'vertical' : 'horizontal', aria = {ariaOrientation: direction};
    this.label = build('span.label');
    this.root = build(`div.slider.${direction}`, this.label, aria, {role: 'slider', tabIndex: 0});
    this.root.ariaLabel = name;
    // The value that the user has chosen, until the detector has it or has refused it; else null.
    this.chosen = null;
    this.drop();
    listen(this.root, 'pointerdown', (event) => this.grip(event));
    listen(this.root, 'pointermove', ({clientX, clientY}) => {
      const {left, top} = this.root.parentElement.getBoundingClientRect();
      if (this.gripped) this.move(this.valueOf(vertical ? clientY - top : clientX - left));
    });
    listen(this.root, 'pointerup', () => this.gripped && this.set());
    listen(this.root, 'pointercancel', () => this.leave());
    listen(this.root, 'keydown', (event) => this.onKey(event));
    listen(this.root, 'blur', () => this.timer && this.set());
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
    const seen = this.chosen ?? value, words = this.words(seen);
    write(this.label, words);
    Object.assign(this.root, {ariaValueNow: `${seen}`, ariaValueText: words});
    Object.assign(this.root, {ariaValueMin: `${least}`, ariaValueMax: `${most}`});
    return seen;
  }

  place(pixel) {
    this.root.style[this.vertical ? 'top' : 'left'] = `${pixel}px`;
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
    }, ANSWERED_MS);
  }

  leave() {
    this.drop();
    this.move(null);
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
    if (this.root.ariaDisabled === 'true' || isShortcut(event)) return;
    if (event.key in STEPS) {
      this.move(this.step(this.chosen ?? this.value, STEPS[event.key]));
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.set(), KEYS_MS);
    } else if (event.key === 'Enter') this.set();
    else if (event.key === 'Escape') this.leave();
    else return;
    event.preventDefault();
    event.stopPropagation();
  }
}
