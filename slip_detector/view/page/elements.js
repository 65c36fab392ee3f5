// Makes the elements of the page: tabs, sliders, announcements.

export const button = (words, onclick, properties = {}) => (
  build('button', words, {type: 'button', onclick, ...properties}));

// What a template holds: its root, and by class the parts in it.
export function partsOf(id) {
  const root = element(id).content.firstElementChild.cloneNode(true), parts = {root};
  for (const part of root.querySelectorAll('[class]')) parts[part.className] = part;
  return parts;
}

// Set properties only where they differ: the browser would lay out, paint or read aloud again.
export function update(target, properties) {
  for (const [name, value] of Object.entries(properties)) {
    if (target[name] !== value) target[name] = value;
  }
}

// Set the text of an element, or of the one with this id.
export function write(where, words) {
  update(typeof where === 'string' ? element(where) : where, {textContent: words});
}

// The key that is meant for the page wherever the focus is, in lower case; else ''.
export function pageKey(event) {
  const isTyped = event.target.matches('input:not([type=range]), select, textarea');
  // They can be switched off, as speech input and accidental strokes trigger them (WCAG 2.1.4).
  const acts = element('keys-act').checked && !isShortcut(event) && !isTyped;
  return acts ? event.key.toLowerCase() : '';
}

// Let a button be held. Enter and screen readers cannot: one click presses, the next one releases.
export function holdable(held, {press, release, isHeld}) {
  listen(held, 'pointerdown', (event) => {
    if (event.button) return;
    held.setPointerCapture(event.pointerId);
    press();
  });
  listen(held, 'pointerup pointercancel', release);
  listen(held, 'contextmenu', (event) => event.preventDefault());
  listen(held, 'click', ({detail}) => detail || (isHeld() ? release() : press()));
  // A hidden page does not notice that the button, or its key, is released.
  listen(window, 'blur', release);
  listen(document, 'visibilitychange', release);
}

export function tableRow([heading, ...cells]) {
  const first = build('th', heading, {scope: 'row'});
  return build('tr', first, ...cells.map((cell) => build('td', cell)));
}

// Names this page in requests, so that it knows its own changes from those of others.
export const PAGE = crypto.getRandomValues(new Uint32Array(2)).join('-');

// A part with controls: fingers by their labels, requests, and the line of why one was refused.
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
    connection.on('parameters', () => this.refuse(''));
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

  // Resolves with the answer to a request. beside: what a refusal is to stand beside from now on.
  async ask(type, content, beside) {
    const {finger, line: {parentElement: place}} = this;
    this.refuse('');
    beside?.after(place);
    const answer = await this.connection.request(type, {finger, page: PAGE, ...content});
    if (answer.refusal) this.refuse(answer.refusal);
    if (beside) place.scrollIntoView({block: 'nearest'});
    return answer;
  }

  refuse(words) {
    const properties = {className: 'dismiss', ariaLabel: 'Dismiss'};
    const dismiss = button('', () => this.refuse(''), properties);
    this.line.replaceChildren(words && `Refused: ${words}`, dismiss);
    this.line.hidden = !words;
  }
}

// Tabs as the ARIA Authoring Practices describe them; onChoose(id): the tab of this id is chosen.
export function tabs(list, onChoose = () => {}) {
  const all = [...list.querySelectorAll('[role=tab]')];
  const choose = (chosen) => {
    for (const tab of all) {
      tab.ariaSelected = String(tab === chosen);
      tab.tabIndex = tab === chosen ? 0 : -1;
      element(tab.getAttribute('aria-controls')).hidden = tab !== chosen;
    }
    onChoose(chosen.id);
  };
  listen(list, 'click', ({target}) => all.includes(target) && choose(target));
  oneTabStop(list, choose);
  choose(all[0]);
}

// Make the buttons of a group one tab stop: arrows, Home and End go from one to another.
export function oneTabStop(group, onMove = () => {}) {
  const buttons = () => [...group.querySelectorAll('button')];
  listen(group, 'keydown', (event) => {
    const all = buttons(), at = all.indexOf(event.target);
    const next = {ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: -1}[event.key];
    if (next === undefined) return;
    event.preventDefault();
    const to = all.at(next % all.length);
    to.focus();
    onMove(to);
  });
  listen(group, 'focusin', ({target}) => {
    for (const each of buttons()) each.tabIndex = each === target ? 0 : -1;
  });
}

// The height of a part of the signals of which the page, unscrolled, shows all and so much below.
export function heightFor(part, below) {
  const boxOf = (each) => each.getBoundingClientRect();
  const above = boxOf(part).top - boxOf(element('signals')).top;
  return window.innerHeight - below - window.scrollY - boxOf(element('fingers')).bottom - above;
}

// Changes in this time are one announcement.
const GATHERED_MS = 1500;

// Announces changes of the fingers to screen readers, without interrupting them.
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
    const lines = [];
    for (const [label, words] of this.present) {
      if (words !== this.announced.get(label)) lines.push(`${label}: ${words}.`);
      this.announced.set(label, words);
    }
    if (lines.length) this.region.textContent = lines.join(' ');
    this.present.clear();
  }
}

// A value moved by keys is set by Enter, or this time after the last key.
const KEYS_MS = 700;
// Longest time between the answer to a change and the message with the new value.
const ANSWERED_MS = 500;
const STEPS = {ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: 10, PageDown: -10};

// A line in a drawing that is dragged, or moved by keys; for screen readers it is a slider.
export class Slider {
  // valueOf(pixel): the value at a pixel of the slider's parent. words(value): its label.
  // step(value, steps): the value so many steps up. onMove(): called when the line has moved.
  // onSet(value): called when it is released; resolves when the change was answered.
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
    const ends = {ariaValueMin: `${least}`, ariaValueMax: `${most}`};
    Object.assign(this.root, {ariaValueNow: `${seen}`, ariaValueText: words, ...ends});
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
