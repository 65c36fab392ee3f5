// A line in a drawing that is dragged, or moved by keys: a slider, as screen readers know it.

// A change by keys is made when no key was pressed for so long, or Enter was.
const KEYS_MS = 700;

export class Slider {
  // vertical: whether the line is moved up and down, else to the left and right.
  // valueOf(pixel): the value at a pixel of the slider's parent. words(value): how it is said.
  // step(value, steps): so many steps up or down. onMove(value): while it moves. onSet(value): it
  // was let go there. onLeft(): moved, but not set.
  constructor({name, vertical, valueOf, words, step, onMove, onSet}) {
    Object.assign(this, {vertical, valueOf, words, step, onMove, onSet});
    this.root = make('div', undefined, `slider ${vertical ? 'vertical' : 'horizontal'}`);
    this.root.role = 'slider';
    this.root.tabIndex = 0;
    this.root.ariaLabel = name;
    this.root.ariaOrientation = vertical ? 'vertical' : 'horizontal';
    this.label = make('span', '', 'label');
    this.root.append(this.label);
    this.moved = null;
    this.timer = null;
    this.root.addEventListener('pointerdown', (event) => this.grip(event));
    this.root.addEventListener('keydown', (event) => this.onKey(event));
    this.root.addEventListener('blur', () => this.timer && this.set());
  }

  // Whether the user moves it: then it does not follow what is shown.
  get held() {
    return this.moved !== null;
  }

  // Show a value, unless the user is about to choose another one, and stand at a pixel.
  show(value, least, most) {
    if (!this.held) this.value = value;
    const shown = this.held ? this.moved : value;
    Object.assign(this.root, {
      ariaValueNow: String(shown), ariaValueMin: String(least), ariaValueMax: String(most), ariaValueText: this.words(shown),
    });
    const label = this.words(shown);
    if (this.label.textContent !== label) this.label.textContent = label;
    return shown;
  }

  place(pixel) {
    this.root.style[this.vertical ? 'top' : 'left'] = `${pixel}px`;
  }

  move(value) {
    this.moved = value;
    this.onMove(value);
  }

  set() {
    clearTimeout(this.timer);
    this.timer = null;
    const value = this.moved;
    this.moved = null;
    if (value !== null && value !== this.value) {
      // Until the detector says what it has, the line stays where it was put.
      this.value = value;
      this.onSet(value);
    }
    this.onMove(this.value);
  }

  leave() {
    clearTimeout(this.timer);
    this.timer = this.moved = null;
    this.onMove(this.value);
  }

  grip(event) {
    if (event.button || this.root.ariaDisabled === 'true') return;
    event.preventDefault();
    event.stopPropagation();
    this.root.focus();
    this.root.setPointerCapture(event.pointerId);
    const at = (moved) => {
      const box = this.root.parentElement.getBoundingClientRect();
      return this.valueOf(this.vertical ? moved.clientY - box.top : moved.clientX - box.left);
    };
    const gripped = new AbortController(), {signal} = gripped;
    this.root.addEventListener('pointermove', (moved) => this.move(at(moved)), {signal});
    this.root.addEventListener('pointerup', () => {
      gripped.abort();
      this.set();
    }, {signal});
    this.root.addEventListener('pointercancel', () => {
      gripped.abort();
      this.leave();
    }, {signal});
    this.root.addEventListener('keydown', ({key}) => {
      if (key !== 'Escape') return;
      gripped.abort();
      this.leave();
    }, {signal});
  }

  onKey(event) {
    const steps = {ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: 10, PageDown: -10}[event.key];
    if (this.root.ariaDisabled === 'true') return;
    if (steps) {
      this.move(this.step(this.moved ?? this.value, steps));
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

// A number with three digits, as it is set.
export const rounded = (value) => Number(value.toPrecision(3));
