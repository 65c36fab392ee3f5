// The card of one finger: its picture, in which each taxel stands at its place with its level as a
// fill, its groups, and its state in words. The style sheet says how taxels look.

import {partsOf, update, write} from './elements.js';

// Words and mark of each state, in the order in which states take the title of the page.
export const STATES = {
  slip: {mark: '\u25b2', words: 'SLIP'},
  lost: {mark: '\u2715', words: 'not connected'},
  silent: {mark: '\u2715', words: 'detector silent'},
  noInput: {mark: '\u2715', words: 'no input'},
  paused: {mark: '\u2016', words: 'paused'},
  notValid: {mark: '?', words: 'not valid'},
  rest: {mark: '\u25cb', words: 'rest'},
};
// Shortest time between two updates of the channels in words.
const WORDS_MS = 1000;
const LEVELS = ['all well', 'warning', 'error', 'stale'], MARKS = '\u2713\u25b2\u2715\u2715';
const VOTES = {all: 'all of them', mean: 'their geometric mean'};

export class FingerCard {
  constructor() {
    Object.assign(this, partsOf('card'));
    listen(this.inWords, 'toggle', () => this.showChannels());
    listen(this.taxels, 'pointermove', ({target, target: {dataset: {channel}}}) => {
      if (channel && this.channels) target.title = this.wordsOf(Number(channel));
    });
  }

  describe(finger, readOnly) {
    this.finger = finger;
    const {offer, label, channels} = finger;
    write(this.take, offer);
    Object.assign(this.take, {disabled: readOnly, ariaLabel: `${offer}: ${label}`});
    this.root.dataset.finger = finger.name;
    write(this.title, label);
    write(this.notice, finger.notice);
    const taxels = channels.map((_, c) => build('i.taxel', {dataset: {channel: c + 1}}));
    const vote = VOTES[finger.vote] ?? `${finger.vote} of them`;
    this.chips = Object.entries(finger.groups).map(([name, members]) => {
      const count = build('span.count'), chip = build('li.group', build('span.name', name), count);
      chip.title = `${name}: ${members.map((c) => channels[c - 1]).join(', ')}; vote: ${vote}`;
      listen(chip, 'pointerenter pointerleave', ({type}) => {
        for (const c of members) taxels[c - 1].classList.toggle('marked', type === 'pointerenter');
      });
      return {chip, count, members};
    });
    this.groups.replaceChildren(...this.chips.map(({chip}) => chip));
    this.taxels.replaceChildren(...taxels);
    this.list.replaceChildren(...channels.map(() => build('li')));
    Object.assign(this, {state: null, channels: null, worded: -Infinity});
    placeTaxels(this.taxels, finger.positions_m);
  }

  show(state, level, on, groups) {
    this.state = state;
    this.channels = Array.from(level, (ratio, c) => ({
      level: ratio, on: Boolean(on[c]), valid: !Number.isNaN(ratio),
      disabled: this.finger.disabled.includes(c + 1),
    }));
    // Drawn in every other frame only, so that a slow machine keeps up.
    this.skips = !this.skips;
    if (!this.skips) this.channels.forEach((seen, c) => showTaxel(this.taxels.children[c], seen));
    this.showState(this.stateName());
    this.chips.forEach(({chip, count, members}, g) => {
      const valid = members.filter((c) => this.channels[c - 1]?.valid);
      const votes = valid.filter((c) => this.channels[c - 1].on).length;
      chip.classList.toggle('on', Boolean(groups[g]));
      write(count, `${votes}/${valid.length}${groups[g] ? ' ON' : ''}`);
    });
    const {onset_age_s: age, slip, valid} = state, ago = seconds(age ?? 0);
    const began = slip ? `slip since ${ago}` : `last slip began ${ago} ago`;
    const words = age === null ? 'no slip so far' : began;
    write(this.onset, `${valid ? 'valid' : 'not valid'}; ${words}`);
    if (performance.now() - this.worded > WORDS_MS) this.showChannels();
  }

  showChannels() {
    if (!this.inWords.open || !this.channels) return;
    this.worded = performance.now();
    this.channels.forEach((_, c) => write(this.list.children[c], this.wordsOf(c + 1)));
  }

  stateName() {
    const {slip, valid, sample_age_s: age, silent, paused} = this.state;
    if (silent) return 'silent';
    const comes = age !== null && age <= Math.max(this.finger.input_timeout_s, 0.25);
    if (!comes) return paused ? 'paused' : 'noInput';
    if (!valid) return 'notValid';
    return slip ? 'slip' : 'rest';
  }

  showState(name) {
    const {mark, words} = STATES[name], {sample_age_s: age, silent, unfit} = this.state;
    if (this.root.dataset.state !== name) {
      this.root.dataset.state = name;
      this.badge.replaceChildren(build('span.mark', mark, {ariaHidden: 'true'}), ` ${words}`);
    }
    const none = age === null ? 'no sample has come yet' : `no sample for ${seconds(age)}`;
    const last = 'as it was last', noInput = unfit || none;
    const veil = {lost: last, paused: last, silent, noInput}[name] ?? '';
    write(this.veil, veil);
    const isDead = (_, c) => !veil && !this.channels[c].valid && !this.channels[c].disabled;
    const dead = this.finger.channels.filter(isDead);
    const deadWords = dead.length ? `${channelWords(dead)} not valid` : '';
    // The line is always there, so that nothing below it moves when a channel fails.
    this.dead.classList.toggle('some', dead.length > 0);
    write(this.dead, deadWords ? `\u2715 ${deadWords}` : veil ? '' : '\u2713 all channels valid');
    this.words = [words, veil, deadWords].filter(Boolean).join(', ');
    update(this.taxels, {ariaLabel: `${this.finger.label}: ${this.words}`});
  }

  // Faults stand at the top. The badge shows decisions sooner than these lines do.
  showDiagnostics(lines) {
    const wrong = lines.filter(([level]) => level).sort(([a], [b]) => b - a);
    const listed = wrong.length ? wrong : lines.filter(([, name]) => name !== 'decisions');
    this.diagnostics.replaceChildren(...listed.map(([level, name, message]) => {
      const ariaLabel = LEVELS[level] ?? 'unknown';
      const lead = build('span.mark', MARKS[level] ?? '?', {role: 'img', ariaLabel});
      return build(`li.level-${level}`, lead, ` ${name}: ${message}`);
    }));
    (wrong.length ? this.dead : this.notice).after(this.diagnostics);
  }

  mark(chosen) {
    this.root.classList.toggle('chosen', chosen);
    this.title.ariaPressed = String(chosen);
  }

  wordsOf(channel) {
    const {level, on, valid, disabled} = this.channels[channel - 1];
    const {groups, channels} = this.finger;
    const group = Object.keys(groups).find((name) => groups[name].includes(channel));
    const ratio = level < 0.005 ? 'less than 0.01' : level.toPrecision(2);
    const known = valid ? `${ratio} of the threshold${on ? ', ON' : ''}` : 'not valid';
    const state = disabled ? 'disabled' : known;
    return [channels[channel - 1], group && `group ${group}`, state].filter(Boolean).join(', ');
  }
}

function channelWords(names) {
  const first = names.slice(0, 4).join(', ');
  if (names.length > 4) return `${first} and ${names.length - 4} more are`;
  return `${first} ${names.length > 1 ? 'are' : 'is'}`;
}

// Rounded so that a running number can be read.
const seconds = (age) => (
  age < 120 ? `${age.toFixed(age < 10 ? 1 : 0)} s` : `${Math.floor(age / 60)} min`);

// Show a channel in its taxel: levels from 1/32 of the threshold, in steps that are hardly seen.
function showTaxel(taxel, {level, on, valid, disabled}) {
  const share = clamp(1 + Math.log2(level) / LEVEL_OCTAVES, 0, 1);
  const shows = disabled ? 'disabled' : !valid ? 'invalid' : on ? 'on' : 'level';
  const fill = shows === 'level' ? `100% ${Math.round(32 * share) / 0.32}%` : '';
  update(taxel.dataset, {shows});
  update(taxel.style, {backgroundSize: fill});
}

// Place taxels in units of the least distance of two, along the two axes of the largest extents.
function placeTaxels(taxels, positions) {
  const extents = [0, 1, 2].map((axis) => {
    const [least, most] = rangeOf(positions.map((position) => position[axis]));
    return {axis, middle: (least + most) / 2, size: most - least};
  });
  const thinnest = extents.reduce((found, extent) => (extent.size <= found.size ? extent : found));
  const [across, along] = extents.filter((extent) => extent !== thinnest);
  const points = positions.map((at) => [across, along].map(({axis, middle}) => at[axis] - middle));
  // As taxels are drawn as squares, the distance of two is the larger of those along the axes.
  const distances = points.flatMap(([x, y], i) => points.slice(0, i).map(
    ([other, above]) => Math.max(Math.abs(x - other), Math.abs(y - above)) || Infinity));
  const [unit] = rangeOf(distances) ?? [Infinity];
  // The outermost taxels have half a unit to the edge.
  taxels.style.cssText = `--wide: ${across.size / unit + 1}; --high: ${along.size / unit + 1}`;
  points.forEach(([x, y], c) => {
    taxels.children[c].style.cssText = `--x: ${x / unit}; --y: ${-y / unit}`;
  });
}
