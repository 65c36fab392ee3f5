// Makes the elements of the page, tabs and announcements.

// A button; properties: those that differ from the usual ones.
export const button = (words, onclick, properties = {}) => (
  build('button', words, {type: 'button', onclick, ...properties}));

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

// Let a button be held. A click without a pointer comes from Enter or a screen reader, which
// cannot hold one: it presses, and the next one releases.
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

// A part with controls: the fingers by their labels, requests, and the line that shows why one was
// refused.
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

  // Send a request about the chosen finger, or another one; resolves with the answer. beside: what
  // the answer stands beside, if not where it stood before.
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

// Tabs as the ARIA Authoring Practices describe them: one tab stop, arrows choose.
// list: the element of role tablist. onChoose(id): called when the panel of this id is shown.
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
  listen(list, 'click', ({target}) => all.includes(target) && choose(target));
  oneTabStop(list, choose);
  choose(all[0]);
}

// Make the buttons of a group one tab stop: arrows, Home and End go from one to another.
// onMove(button): called with the one that has the focus then.
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

// The height that a part of the signals may have so that the page, unscrolled, shows all of it
// with so much below it.
export function heightFor(part, below) {
  const boxOf = (each) => each.getBoundingClientRect();
  const above = boxOf(part).top - boxOf(element('signals')).top;
  return window.innerHeight - below - window.scrollY - boxOf(element('fingers')).bottom - above;
}

// Changes in this time are one announcement: slip may come and go many times a second.
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
    const isNew = ([label, words]) => words !== this.announced.get(label);
    const fresh = [...this.present].filter(isNew);
    const lines = fresh.map(([label, words]) => `${label}: ${words}.`);
    if (fresh.length) this.region.textContent = lines.join(' ');
    this.announced = new Map([...this.announced, ...this.present]);
    this.present.clear();
  }
}
