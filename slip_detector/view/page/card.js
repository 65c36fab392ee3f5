// The card of one finger: its picture, in which each taxel stands at its place with its level as a fill,
// its groups, and its state in words.

import {write} from './elements.js';

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
// Pixels that stay free around the picture.
const MARGIN = 4;
// Of diagnostics.
const LEVELS = [['\u2713', 'all well'], ['\u25b2', 'warning'], ['\u2715', 'error'], ['\u2715', 'stale']];
const VOTES = {all: 'all of them', mean: 'their geometric mean'};

export class FingerCard {
  // onChoose(): the user wants to see the finger's traces. onChannel(channel): the taxel of a channel,
  // counted from 1, was clicked. onTake(): the detector is to take the samples as they come.
  constructor({onChoose, onChannel, onTake}) {
    this.root = element('card').content.firstElementChild.cloneNode(true);
    for (const part of this.root.querySelectorAll('[class]')) this[part.className] = part;
    this.title.addEventListener('click', onChoose);
    this.take.addEventListener('click', onTake);
    this.inWords.addEventListener('toggle', () => this.showChannels());
    this.marked = [];
    this.worded = -Infinity;
    const at = (kind, act) => this.canvas.addEventListener(kind, (event) => act(this.channelAt(event)));
    at('click', (channel) => channel && onChannel(channel));
    at('pointermove', (channel) => (this.canvas.title = channel && this.channels ? this.wordsOf(channel) : ''));
    // The size of the picture is known only once the page is laid out.
    new ResizeObserver(() => this.layOut()).observe(this.picture);
  }

  // Show the server's description of the finger, which changes with the detector's parameters.
  describe(finger, readOnly) {
    this.finger = finger;
    Object.assign(this.take, {
      textContent: finger.offer, hidden: !finger.offer, disabled: readOnly, ariaLabel: `${finger.offer}: ${finger.label}`,
    });
    this.root.dataset.finger = finger.name;
    write(this.title, finger.label);
    write(this.notice, finger.notice);
    this.notice.hidden = !finger.notice;
    this.chips = Object.entries(finger.groups).map(([name, members]) => {
      const count = build('span.count'), chip = build('li.group', build('span.name', name), count);
      chip.title = `${name}: ${members.map((c) => finger.channels[c - 1]).join(', ')}; vote: ${VOTES[finger.vote] ?? `${finger.vote} of them`}`;
      chip.addEventListener('pointerenter', () => this.paint(members));
      chip.addEventListener('pointerleave', () => this.paint([]));
      return {chip, count, members};
    });
    this.groups.replaceChildren(...this.chips.map(({chip}) => chip));
    this.state = null;
    this.layOut();
  }

  layOut() {
    const {clientWidth: width, clientHeight: height} = this.picture;
    if (!this.finger || !width || !height) return;
    this.context = fitted(this.canvas).context;
    this.painted = null;
    this.places = placesOf(this.finger.positions_m, width, height);
    this.paint();
  }

  // The finger's state in a frame, and its arrays there.
  show(state, {level, on, groups}) {
    this.state = state;
    this.channels = Array.from(level, (ratio, c) => ({
      level: ratio, fill: fillOf(ratio), on: Boolean(on[c]), valid: !Number.isNaN(ratio), disabled: this.finger.disabled.includes(c + 1),
    }));
    this.showState(this.stateName());
    this.chips.forEach(({chip, count, members}, g) => {
      const valid = members.filter((c) => this.channels[c - 1]?.valid);
      const votes = valid.filter((c) => this.channels[c - 1].on).length;
      chip.classList.toggle('on', Boolean(groups[g]));
      write(count, `${votes}/${valid.length}${groups[g] ? ' ON' : ''}`);
    });
    write(this.onset, this.onsetWords());
    if (performance.now() - this.worded > WORDS_MS) this.showChannels();
    this.paint();
  }

  // For users who cannot see the picture.
  showChannels() {
    if (!this.inWords.open || !this.channels) return;
    this.worded = performance.now();
    const {list} = this;
    while (list.children.length > this.channels.length) list.lastChild.remove();
    this.channels.forEach((_, c) => write(list.children[c] ?? list.appendChild(build('li')), this.wordsOf(c + 1)));
  }

  stateName() {
    const {slip, valid, sample_age_s: age, silent} = this.state;
    if (silent) return 'silent';
    if (age === null || age > Math.max(this.finger.input_timeout_s, 0.25)) return 'noInput';
    if (!valid) return 'notValid';
    return slip ? 'slip' : 'rest';
  }

  showState(name) {
    const {mark, words} = STATES[name], {sample_age_s: age, silent, unfit} = this.state;
    if (this.root.dataset.state !== name) {
      this.root.dataset.state = name;
      this.badge.replaceChildren(build('span.mark', mark, {ariaHidden: 'true'}), ` ${words}`);
    }
    const noSample = unfit || (age === null ? 'no sample has come yet' : `no sample for ${seconds(age)}`);
    const veil = {lost: 'as it was last', silent, noInput: noSample}[name] ?? '';
    write(this.veil, veil);
    this.veil.hidden = !veil;
    const dead = veil ? [] : this.finger.channels.filter((_, c) => !this.channels[c].valid && !this.channels[c].disabled);
    const deadWords = dead.length ? `${channelWords(dead)} not valid` : '';
    // The line is always there, so that nothing below it moves when a channel fails.
    this.dead.classList.toggle('some', dead.length > 0);
    write(this.dead, deadWords ? `\u2715 ${deadWords}` : veil ? '' : '\u2713 all channels valid');
    this.words = [words, veil, deadWords].filter(Boolean).join(', ');
    const label = `${this.finger.label}: ${this.words}`;
    if (this.canvas.ariaLabel !== label) this.canvas.ariaLabel = label;
  }

  onsetWords() {
    const {onset_age_s: age, slip, valid} = this.state;
    const since = age === null ? 'no slip so far' : slip ? `slip since ${seconds(age)}` : `last slip began ${seconds(age)} ago`;
    return `${valid ? 'valid' : 'not valid'}; ${since}`;
  }

  // lines: [level, name, message] of each. What is wrong stands at the top; of decisions the badge tells sooner.
  showDiagnostics(lines) {
    const wrong = lines.filter(([level]) => level).sort(([a], [b]) => b - a);
    const shown = wrong.length ? wrong : lines.filter(([, name]) => name !== 'decisions');
    this.diagnostics.replaceChildren(...shown.map(([level, name, message]) => {
      const [mark, ariaLabel] = LEVELS[level] ?? ['?', 'unknown'];
      return build(`li.level-${level}`, build('span.mark', mark, {role: 'img', ariaLabel}), ` ${name}: ${message}`);
    }));
    (wrong.length ? this.dead : this.notice).after(this.diagnostics);
  }

  mark(chosen) {
    this.root.classList.toggle('chosen', chosen);
    this.title.ariaPressed = String(chosen);
  }

  // marked: the channels around which there is a frame, counted from 1.
  paint(marked = this.marked) {
    this.marked = marked;
    if (!this.state || !this.places) return;
    // While what is seen stays the same, nothing has to be painted.
    const colors = palette(), picture = JSON.stringify([colors.ground, this.channels.map(({level, ...seen}) => seen), this.marked]);
    if (picture === this.painted) return;
    this.painted = picture;
    const {context, places} = this;
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    places.forEach((place, c) => paintTaxel(context, colors, place, this.channels[c], c + 1));
    Object.assign(context, {strokeStyle: colors.focus, lineWidth: 2});
    context.setLineDash([3, 2]);
    for (const channel of this.marked) {
      const {x, y, side} = places[channel - 1], reach = side / 2 + 3;
      context.strokeRect(x - reach, y - reach, 2 * reach, 2 * reach);
    }
    context.setLineDash([]);
  }

  channelAt({offsetX, offsetY}) {
    const c = (this.places ?? []).findIndex(({x, y, side}) => (
      Math.abs(offsetX - x) <= side / 2 && Math.abs(offsetY - y) <= side / 2));
    return c + 1;
  }

  wordsOf(channel) {
    const {level, on, valid, disabled} = this.channels[channel - 1];
    const group = Object.entries(this.finger.groups).find(([, members]) => members.includes(channel));
    const ratio = level < 0.005 ? 'less than 0.01' : level.toPrecision(2);
    const state = disabled ? 'disabled' : valid ? `${ratio} of the threshold${on ? ', ON' : ''}` : 'not valid';
    return [this.finger.channels[channel - 1], group && `group ${group[0]}`, state].filter(Boolean).join(', ');
  }
}

function channelWords(names) {
  const shown = names.slice(0, 4).join(', ');
  return names.length > 4 ? `${shown} and ${names.length - 4} more are` : `${shown} ${names.length > 1 ? 'are' : 'is'}`;
}

// Rounded so that a running number can be read.
const seconds = (age) => (
  age < 120 ? `${age.toFixed(age < 10 ? 1 : 0)} s` : `${Math.floor(age / 60)} min`);

// The colours of the style sheet, light or dark, by name.
function palette() {
  const style = getComputedStyle(document.documentElement);
  const names = ['ground', 'loud', 'soft', 'edge', 'fault', 'focus', 'quiet', 'level', 'off'];
  return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`)]));
}

// Where taxels are drawn, in pixels: for each channel {x, y, side}, x and y of its middle.
// positions: [x, y, z] in metres of each channel, no two the same. The two axes along which the finger
// is largest are shown.
function placesOf(positions, width, height) {
  const extents = [0, 1, 2].map((axis) => {
    const along = positions.map((position) => position[axis]), least = Math.min(...along);
    return {axis, least, size: Math.max(...along) - least};
  });
  const thinnest = extents.reduce((found, extent) => (extent.size <= found.size ? extent : found));
  const [across, along] = extents.filter((extent) => extent !== thinnest);
  const points = positions.map((position) => [across, along].map(({axis, least}) => position[axis] - least));
  // As taxels are drawn as squares, the distance of two is the larger of those along the axes.
  const pitch = points.reduce((smallest, [x, y], i) => points.slice(0, i).reduce(
    (found, [other, above]) => Math.min(found, Math.max(Math.abs(x - other), Math.abs(y - above)) || found), smallest), Infinity);
  // The outermost taxels have half a pitch to the edge.
  const spacing = Number.isFinite(pitch) ? pitch : 1;
  const scale = Math.min((width - 2 * MARGIN) / (across.size + spacing), (height - 2 * MARGIN) / (along.size + spacing));
  const side = Math.min(0.96 * scale * spacing - 1, 56);
  return points.map(([x, y]) => ({
    x: width / 2 + scale * (x - across.size / 2), y: height / 2 - scale * (y - along.size / 2), side,
  }));
}

// How high a level stands in its taxel: 0 at 1/32 of the threshold or less, 1 at the threshold; in steps
// that can hardly be seen.
const fillOf = (level) => Math.round(64 * Math.max(0, Math.min(1, 1 + Math.log2(level) / LEVEL_OCTAVES))) / 64;

function paintTaxel(context, colors, {x, y, side}, {fill, on, valid, disabled}, number) {
  const left = x - side / 2, top = y - side / 2, shape = new Path2D();
  shape.roundRect(left, top, side, side, side / 5);
  for (const style of disabled ? [colors.off] : !valid ? [colors.ground, HATCHING] : [on ? ON : colors.quiet]) {
    context.fillStyle = style;
    context.fill(shape);
  }
  if (!disabled && valid && !on) {
    context.save();
    context.clip(shape);
    context.fillStyle = colors.level;
    context.fillRect(left, top + side * (1 - fill), side, side * fill);
    context.restore();
  }
  if (!disabled) {
    Object.assign(context, {strokeStyle: on ? colors.loud : colors.edge, lineWidth: on ? Math.min(3, Math.max(1.5, side / 8)) : 1});
    context.stroke(shape);
  }
  if (side < 17) return;
  const letters = (words, weight, size, color, outlined) => {
    Object.assign(context, {font: `${weight} ${size}px system-ui, 'DejaVu Sans', sans-serif`, fillStyle: color});
    if (outlined) context.strokeText(words, x, y);
    context.fillText(words, x, y);
  };
  Object.assign(context, {textAlign: 'center', textBaseline: 'middle', strokeStyle: colors.ground, lineWidth: 3, lineJoin: 'round'});
  if (!disabled && !valid) letters('\u2715', 700, side, colors.fault, false);
  // Letters with an outline are legible on any fill; on the colour of ON they need none.
  letters(number, on ? 700 : 500, Math.min(13, side / 2), disabled ? colors.soft : on ? '#000' : colors.loud, !on);
}
