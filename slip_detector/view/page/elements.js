// Makes the elements of the page, tabs and announcements.

// A button; properties: those that differ from the usual ones.
export function button(words, act, properties = {}) {
  const made = build('button', words, {type: 'button', ...properties});
  made.addEventListener('click', act);
  return made;
}

// Set the text of an element, or of the one with this id, only if it has changed: a screen reader would read it
// again, and the browser lay it out.
export function write(where, words) {
  const place = typeof where === 'string' ? element(where) : where;
  if (place.textContent !== words) place.textContent = words;
}

// Let a button be held. A click without a pointer comes from Enter or a screen reader, which cannot hold one: it presses,
// and the next one releases.
export function holdable(held, {press, release, isHeld}) {
  held.addEventListener('pointerdown', (event) => {
    if (event.button) return;
    held.setPointerCapture(event.pointerId);
    press();
  });
  for (const end of ['pointerup', 'pointercancel']) held.addEventListener(end, release);
  held.addEventListener('contextmenu', (event) => event.preventDefault());
  held.addEventListener('click', ({detail}) => detail || (isHeld() ? release() : press()));
  // A hidden page does not notice that the button, or its key, is released.
  window.addEventListener('blur', release);
  document.addEventListener('visibilitychange', release);
}

export const tableRow = ([heading, ...cells]) => build('tr', build('th', heading, {scope: 'row'}), ...cells.map((cell) => build('td', cell)));

// A part with controls: the fingers by their labels, requests, and the line that shows why one was refused.
export class Tool {
  constructor(connection, line) {
    Object.assign(this, {connection, line, finger: null, labels: {}, readOnly: false});
    connection.on('fingers', ({fingers, read_only: readOnly}) => {
      this.labels = Object.fromEntries(fingers.map(({name, label}) => [name, label]));
      this.readOnly = readOnly;
      if (!(this.finger in this.labels)) this.refuse('');
      this.show();
    });
    connection.on('state', () => {
      this.refuse('');
      this.show();
    });
    // A refusal is about the parameters as they were.
    connection.on('parameters', ({fingers}) => {
      const newest = fingers[this.finger]?.changes[0]?.[0];
      if (newest !== this.newest) this.refuse('');
      this.newest = newest;
    });
  }

  choose(finger) {
    this.finger = finger;
    this.refuse('');
    this.show();
  }

  // Whether nothing can be changed from here now.
  get locked() {
    return this.readOnly || Boolean(this.connection.words);
  }

  // Send a request about the chosen finger, or another one; resolves with the answer. beside: what the answer
  // stands beside, if not where it stood before.
  async ask(type, content, beside) {
    this.refuse('');
    beside?.after(this.line.parentElement);
    const answer = await this.connection.request(type, {finger: this.finger, page: PAGE, ...content});
    if (answer.refusal) this.refuse(answer.refusal);
    if (beside) this.line.parentElement.scrollIntoView({block: 'nearest'});
    return answer;
  }

  refuse(words) {
    this.line.replaceChildren(words && `Refused: ${words}`, button('', () => this.refuse(''), {className: 'dismiss', ariaLabel: 'Dismiss'}));
    this.line.hidden = !words;
  }
}

// Names this page in requests, so that it knows its own changes from those of others.
export const PAGE = crypto.getRandomValues(new Uint32Array(2)).join('-');

// Tabs as the ARIA Authoring Practices describe them: one tab stop, arrows choose.
// list: the element with the role tablist. onChoose(id): called when the panel of this id is shown.
export function tabs(list, onChoose = () => {}) {
  const all = [...list.querySelectorAll('[role=tab]')];
  const panelOf = (tab) => tab.getAttribute('aria-controls');
  const choose = (chosen) => {
    for (const tab of all) {
      tab.ariaSelected = String(tab === chosen);
      tab.tabIndex = tab === chosen ? 0 : -1;
      element(panelOf(tab)).hidden = tab !== chosen;
    }
    onChoose(panelOf(chosen));
  };
  list.addEventListener('click', ({target}) => {
    if (all.includes(target)) choose(target);
  });
  oneTabStop(list, choose);
  choose(all[0]);
}

// Make the buttons of a group one tab stop: arrows, Home and End go from one to another.
// onMove(button): called with the one that has the focus then.
export function oneTabStop(group, onMove = () => {}) {
  const buttons = () => [...group.querySelectorAll('button')];
  group.addEventListener('keydown', (event) => {
    const all = buttons(), at = all.indexOf(event.target);
    const next = {ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: -1}[event.key];
    if (next === undefined) return;
    event.preventDefault();
    const to = all.at(next % all.length);
    to.focus();
    onMove(to);
  });
  group.addEventListener('focusin', ({target}) => {
    for (const one of buttons()) one.tabIndex = one === target ? 0 : -1;
  });
}

// The height that a part of the signals may have so that the page, unscrolled, shows all of it with so much below it.
export const heightFor = (part, below) => window.innerHeight - below - window.scrollY - element('fingers').getBoundingClientRect().bottom
  + element('signals').getBoundingClientRect().top - part.getBoundingClientRect().top;

// A range that grows at once, with a margin on either side, but shrinks only when less than this share of
// it is wanted: one that followed each value would make curves jump.
export function steady(before, [least, most], share, margin = 0) {
  const size = most - least;
  const fits = before && least >= before[0] && most <= before[1] && size > share * (before[1] - before[0]);
  return fits ? before : [least - margin * size, most + margin * size];
}

// Announces changes of the fingers to screen readers, without interrupting them; those within so many
// milliseconds together, as slip may come and go many times a second.
const GATHERED_MS = 1500;

export class News {
  constructor(region) {
    Object.assign(this, {region, announced: new Map(), present: new Map()});
    setInterval(() => this.say(), GATHERED_MS);
  }

  // Note the present state of a finger, again and again. Slip is kept until it is announced.
  note(label, words) {
    if (!this.present.get(label)?.startsWith('SLIP')) this.present.set(label, words);
  }

  say() {
    const fresh = [...this.present].filter(([label, words]) => words !== this.announced.get(label));
    if (fresh.length) this.region.textContent = fresh.map(([label, words]) => `${label}: ${words}.`).join(' ');
    this.announced = new Map([...this.announced, ...this.present]);
    this.present.clear();
  }
}

// A value moved by keys is set by Enter, or this time after the last key.
const KEYS_MS = 700;
// Longest time between the answer to a change and the message with the new value.
const SHOWN_MS = 500;
const STEPS = {ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: 10, PageDown: -10};

// A line in a drawing that is dragged, or moved by keys; for screen readers it is a slider.
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
    on('pointermove', ({clientX, clientY}) => {
      const box = this.root.parentElement.getBoundingClientRect();
      if (this.gripped) this.move(this.valueOf(vertical ? clientY - box.top : clientX - box.left));
    });
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
    } else if (event.key === 'Enter') this.set();
    else if (event.key === 'Escape') this.leave();
    else return;
    event.preventDefault();
    event.stopPropagation();
  }
}

// A value with three significant digits, as it is set.
export const rounded = (value) => Number(value.toPrecision(3));
