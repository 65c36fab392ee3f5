// The card of one finger: its picture, its groups, and how it is in words.

import {paintFinger, pictureOf, placesOf} from './finger.js';

// Words and mark of each state; the first that applies is shown. The shapes of the marks tell states
// apart without colours.
const STATES = {
  lost: {mark: '\u2715', words: 'not connected'},
  silent: {mark: '\u2715', words: 'detector silent'},
  noInput: {mark: '\u2715', words: 'no input'},
  notValid: {mark: '?', words: 'not valid'},
  slip: {mark: '\u25b2', words: 'SLIP'},
  rest: {mark: '\u25cb', words: 'rest'},
};
// Shortest time between two updates of the channels in words.
const WORDS_MS = 1000;
const MARKS = ['\u2713', '\u25b2', '\u2715', '\u2715'];
const LEVELS = ['all well', 'warning', 'error', 'stale'];

export class FingerCard {
  // onChoose(): the user wants to see the finger's traces. onChannel(channel): the taxel of a channel,
  // counted from 1, was clicked.
  constructor({onChoose, onChannel}) {
    this.root = make('article', undefined, 'finger');
    this.title = make('button', undefined, 'title');
    this.title.addEventListener('click', onChoose);
    const heading = make('h2');
    heading.append(this.title);
    this.badge = make('p', undefined, 'badge');
    this.dead = make('p', undefined, 'dead');
    const head = make('header');
    head.append(heading, this.badge);
    this.canvas = make('canvas');
    this.canvas.role = 'img';
    this.picture = make('div', undefined, 'picture');
    this.veil = make('p', undefined, 'veil');
    this.picture.append(this.canvas, this.veil);
    this.groups = make('ul', undefined, 'groups');
    this.onset = make('p', undefined, 'onset');
    this.notice = make('p', undefined, 'notice');
    this.diagnostics = make('ul', undefined, 'diagnostics');
    this.diagnostics.ariaLabel = 'Diagnostics';
    this.inWords = make('details');
    const list = make('ul');
    list.tabIndex = 0;
    list.ariaLabel = 'Channels';
    this.inWords.append(make('summary', 'Channels in words'), list);
    this.inWords.addEventListener('toggle', () => this.tellChannels());
    this.root.append(head, this.dead, this.picture, this.groups, this.onset, this.notice, this.diagnostics, this.inWords);
    this.marked = new Set();
    this.worded = -Infinity;
    this.canvas.addEventListener('click', (event) => {
      const channel = this.channelAt(event);
      if (channel) onChannel(channel);
    });
    this.canvas.addEventListener('pointermove', (event) => this.tellChannel(this.channelAt(event)));
    // The size of the picture is known only once the page is laid out.
    this.resized = new ResizeObserver(() => this.layOut());
    this.resized.observe(this.picture);
  }

  close() {
    this.resized.disconnect();
    this.root.remove();
  }

  // Show the server's description of the finger, which changes with the detector's parameters.
  describe(finger) {
    const alike = JSON.stringify(finger) === this.described;
    if (alike) return;
    this.described = JSON.stringify(finger);
    this.finger = finger;
    this.disabled = new Set(finger.disabled);
    this.root.dataset.finger = finger.name;
    text(this.title, finger.label);
    text(this.notice, finger.notice);
    this.notice.hidden = !finger.notice;
    this.chips = Object.entries(finger.groups).map(([name, members]) => {
      const chip = make('li', undefined, 'group'), label = make('span', name, 'name'), count = make('span', '', 'count');
      const mark = (set) => () => {
        this.marked = new Set(set);
        this.paint();
      };
      chip.append(label, count);
      chip.title = `${name}: ${members.map((c) => finger.channels[c - 1]).join(', ')}; vote: ${voteWords(finger.vote)}`;
      chip.addEventListener('pointerenter', mark(members));
      chip.addEventListener('pointerleave', mark([]));
      return {chip, count, members};
    });
    this.groups.replaceChildren(...this.chips.map(({chip}) => chip));
    this.groups.ariaLabel = 'Groups: channels that are ON of those that are valid';
    this.state = null;
    this.layOut();
  }

  // Show that the connection is lost, and the picture old.
  lose() {
    if (this.state) this.tellState('lost');
  }

  layOut() {
    const {clientWidth: width, clientHeight: height} = this.picture;
    if (!this.finger || !width || !height) return;
    const ratio = window.devicePixelRatio || 1;
    Object.assign(this.canvas, {width: Math.round(width * ratio), height: Math.round(height * ratio)});
    this.canvas.getContext('2d').setTransform(ratio, 0, 0, ratio, 0, 0);
    this.size = {width, height};
    this.painted = null;
    this.places = placesOf(this.finger.positions_m, width - 8, height - 8);
    for (const place of this.places) {
      place.x += 4;
      place.y += 4;
    }
    this.paint();
  }

  // state: {slip, valid, onset_age_s, sample_age_s, silent} of a frame, and its arrays level, on and
  // groups of this finger.
  show(state, {level, on, groups}) {
    this.state = state;
    this.channels = Array.from(level, (ratio, c) => ({
      level: ratio, on: Boolean(on[c]), valid: !Number.isNaN(ratio), disabled: this.disabled.has(c + 1),
    }));
    const name = this.stateName();
    this.tellState(name);
    this.chips.forEach(({chip, count, members}, g) => {
      const valid = members.filter((c) => this.channels[c - 1]?.valid);
      const votes = valid.filter((c) => this.channels[c - 1].on).length;
      chip.classList.toggle('on', Boolean(groups[g]));
      text(count, `${votes}/${valid.length}${groups[g] ? ' ON' : ''}`);
    });
    text(this.onset, this.onsetWords());
    if (performance.now() - this.worded > WORDS_MS) this.tellChannels();
    this.paint();
  }

  // Show the level of each channel in words, for users who cannot see the picture.
  tellChannels() {
    if (!this.inWords.open || !this.channels) return;
    this.worded = performance.now();
    const list = this.inWords.lastChild;
    while (list.children.length > this.channels.length) list.lastChild.remove();
    this.channels.forEach((_, c) => {
      if (!list.children[c]) list.append(make('li'));
      text(list.children[c], this.wordsOf(c + 1));
    });
  }

  stateName() {
    const {slip, valid, sample_age_s: age, silent} = this.state;
    if (silent) return 'silent';
    if (age === null || age > Math.max(this.finger.input_timeout_s, 0.25)) return 'noInput';
    if (!valid) return 'notValid';
    return slip ? 'slip' : 'rest';
  }

  tellState(name) {
    const {mark, words} = STATES[name], {sample_age_s: age, silent} = this.state;
    if (this.root.dataset.state !== name) {
      this.root.dataset.state = name;
      this.badge.replaceChildren(make('span', mark, 'mark'), ` ${words}`);
      this.badge.firstChild.ariaHidden = 'true';
    }
    const veil = {
      lost: 'as it was last', silent, noInput: age === null ? 'no sample has come yet' : `no sample for ${seconds(age)}`,
    }[name] ?? '';
    text(this.veil, veil);
    this.veil.hidden = !veil;
    const dead = name === 'slip' || name === 'rest' || name === 'notValid' ? this.deadChannels() : [];
    // The line is always there, so that nothing below it moves when a channel fails.
    this.dead.classList.toggle('some', dead.length > 0);
    text(this.dead, dead.length ? `\u2715 ${channelWords(dead)} not valid` : veil ? '' : '\u2713 all channels valid');
    this.words = [words, ...(veil ? [veil] : []), ...(dead.length ? [`${channelWords(dead)} not valid`] : [])].join(', ');
    const label = `${this.finger.label}: ${this.words}`;
    if (this.canvas.ariaLabel !== label) this.canvas.ariaLabel = label;
  }

  deadChannels() {
    return this.finger.channels.filter((_, c) => !this.channels[c].valid && !this.channels[c].disabled);
  }

  onsetWords() {
    const {onset_age_s: age, slip, valid} = this.state;
    const held = valid ? 'valid' : 'not valid';
    if (age === null) return `${held}; no slip so far`;
    return slip ? `${held}; slip since ${seconds(age)}` : `${held}; last slip began ${seconds(age)} ago`;
  }

  // lines: [level, name, message] of each diagnostic.
  tellDiagnostics(lines) {
    const key = JSON.stringify(lines);
    if (key === this.told) return;
    this.told = key;
    this.diagnostics.replaceChildren(...lines.map(([level, name, message]) => {
      const line = make('li', undefined, `level-${level}`), mark = make('span', MARKS[level] ?? '?', 'mark');
      mark.role = 'img';
      mark.ariaLabel = LEVELS[level] ?? 'unknown';
      line.append(mark, ` ${name}: ${message}`);
      return line;
    }));
    // With a tab stop, keys can scroll a list that does not fit.
    this.diagnostics.tabIndex = this.diagnostics.scrollHeight > this.diagnostics.clientHeight ? 0 : -1;
  }

  mark(chosen) {
    this.root.classList.toggle('chosen', chosen);
    this.title.ariaPressed = String(chosen);
  }

  paint() {
    if (!this.state || !this.places) return;
    const picture = pictureOf(this.places, this.channels, this.marked);
    if (picture === this.painted) return;
    this.painted = picture;
    const context = this.canvas.getContext('2d');
    context.clearRect(0, 0, this.size.width, this.size.height);
    paintFinger(context, this.places, this.channels, this.marked);
  }

  channelAt({offsetX, offsetY}) {
    const c = (this.places ?? []).findIndex(({x, y, side}) => (
      Math.abs(offsetX - x) <= side / 2 && Math.abs(offsetY - y) <= side / 2));
    return c + 1;
  }

  tellChannel(channel) {
    this.canvas.title = channel && this.channels ? this.wordsOf(channel) : '';
  }

  wordsOf(channel) {
    const {level, on, valid, disabled} = this.channels[channel - 1];
    const group = Object.entries(this.finger.groups).find(([, members]) => members.includes(channel));
    const words = [this.finger.channels[channel - 1], ...(group ? [`group ${group[0]}`] : [])];
    if (disabled) words.push('disabled');
    else if (!valid) words.push('not valid');
    else words.push(`${ratioWords(level)} of the threshold${on ? ', ON' : ''}`);
    return words.join(', ');
  }
}

export const ratioWords = (level) => (level < 0.005 ? 'less than 0.01' : level.toPrecision(2));

export function voteWords(vote) {
  if (vote === 'all') return 'all of them';
  return vote === 'mean' ? 'their geometric mean' : `${vote} of them`;
}

function channelWords(names) {
  const shown = names.slice(0, 4).join(', ');
  return names.length > 4 ? `${shown} and ${names.length - 4} more are` : `${shown} ${names.length > 1 ? 'are' : 'is'}`;
}

// Rounded so that a running number can be read.
function seconds(age) {
  if (age < 10) return `${age.toFixed(1)} s`;
  return age < 120 ? `${age.toFixed(0)} s` : `${Math.floor(age / 60)} min`;
}

// Set a text only if it has changed: a screen reader would read it again, and the browser lay it out.
function text(element, words) {
  if (element.textContent !== words) element.textContent = words;
}
