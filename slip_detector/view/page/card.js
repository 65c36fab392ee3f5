// The card of one finger: its picture, in which each taxel stands at its place with its level as a fill,
// its groups, and its state in words.

import {build, button} from './elements.js';

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
    this.title = button('', onChoose, {className: 'title'});
    this.badge = build('p.badge');
    this.dead = build('p.dead');
    this.canvas = build('canvas', {role: 'img'});
    this.veil = build('p.veil');
    this.picture = build('div.picture', this.canvas, this.veil);
    this.groups = build('ul.groups', {ariaLabel: 'Groups: channels that are ON of those that are valid'});
    this.onset = build('p.onset');
    this.notice = build('p.notice');
    this.diagnostics = build('ul.diagnostics', {ariaLabel: 'Diagnostics'});
    this.list = build('ul', {tabIndex: 0, ariaLabel: 'Channels'});
    this.inWords = build('details', build('summary', 'Channels in words'), this.list);
    this.inWords.addEventListener('toggle', () => this.showChannels());
    this.root = build('article.finger', build('header', build('h2', this.title), this.badge), this.dead, this.picture,
      this.groups, this.onset, this.notice, this.diagnostics, this.inWords);
    this.marked = new Set();
    this.worded = -Infinity;
    this.canvas.addEventListener('click', (event) => {
      const channel = this.channelAt(event);
      if (channel) onChannel(channel);
    });
    this.canvas.addEventListener('pointermove', (event) => this.showChannel(this.channelAt(event)));
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
    const described = JSON.stringify(finger);
    if (described === this.described) return;
    this.described = described;
    this.finger = finger;
    this.disabled = new Set(finger.disabled);
    this.root.dataset.finger = finger.name;
    text(this.title, finger.label);
    text(this.notice, finger.notice);
    this.notice.hidden = !finger.notice;
    this.chips = Object.entries(finger.groups).map(([name, members]) => {
      const mark = (set) => () => {
        this.marked = new Set(set);
        this.paint();
      };
      const count = build('span.count'), chip = build('li.group', build('span.name', name), count);
      chip.title = `${name}: ${members.map((c) => finger.channels[c - 1]).join(', ')}; vote: ${voteWords(finger.vote)}`;
      chip.addEventListener('pointerenter', mark(members));
      chip.addEventListener('pointerleave', mark([]));
      return {chip, count, members};
    });
    this.groups.replaceChildren(...this.chips.map(({chip}) => chip));
    this.state = null;
    this.layOut();
  }

  // Show that the connection is lost, and the picture old.
  lose() {
    if (this.state) this.showState('lost');
  }

  layOut() {
    const {clientWidth: width, clientHeight: height} = this.picture;
    if (!this.finger || !width || !height) return;
    const ratio = window.devicePixelRatio || 1;
    Object.assign(this.canvas, {width: Math.round(width * ratio), height: Math.round(height * ratio)});
    this.canvas.getContext('2d').setTransform(ratio, 0, 0, ratio, 0, 0);
    this.size = {width, height};
    this.painted = null;
    this.places = placesOf(this.finger.positions_m, width, height, 4);
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
    this.showState(name);
    this.chips.forEach(({chip, count, members}, g) => {
      const valid = members.filter((c) => this.channels[c - 1]?.valid);
      const votes = valid.filter((c) => this.channels[c - 1].on).length;
      chip.classList.toggle('on', Boolean(groups[g]));
      text(count, `${votes}/${valid.length}${groups[g] ? ' ON' : ''}`);
    });
    text(this.onset, this.onsetWords());
    if (performance.now() - this.worded > WORDS_MS) this.showChannels();
    this.paint();
  }

  // Show the level of each channel in words, for users who cannot see the picture.
  showChannels() {
    if (!this.inWords.open || !this.channels) return;
    this.worded = performance.now();
    const {list} = this;
    while (list.children.length > this.channels.length) list.lastChild.remove();
    this.channels.forEach((_, c) => {
      if (!list.children[c]) list.append(build('li'));
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

  showState(name) {
    const {mark, words} = STATES[name], {sample_age_s: age, silent} = this.state;
    if (this.root.dataset.state !== name) {
      this.root.dataset.state = name;
      this.badge.replaceChildren(build('span.mark', mark, {ariaHidden: 'true'}), ` ${words}`);
    }
    const veil = {
      lost: 'as it was last', silent, noInput: age === null ? 'no sample has come yet' : `no sample for ${seconds(age)}`,
    }[name] ?? '';
    text(this.veil, veil);
    this.veil.hidden = !veil;
    const dead = ['slip', 'rest', 'notValid'].includes(name)
      ? this.finger.channels.filter((_, c) => !this.channels[c].valid && !this.channels[c].disabled) : [];
    // The line is always there, so that nothing below it moves when a channel fails.
    this.dead.classList.toggle('some', dead.length > 0);
    text(this.dead, dead.length ? `\u2715 ${channelWords(dead)} not valid` : veil ? '' : '\u2713 all channels valid');
    this.words = [words, veil, dead.length && `${channelWords(dead)} not valid`].filter(Boolean).join(', ');
    const label = `${this.finger.label}: ${this.words}`;
    if (this.canvas.ariaLabel !== label) this.canvas.ariaLabel = label;
  }

  onsetWords() {
    const {onset_age_s: age, slip, valid} = this.state;
    const validity = valid ? 'valid' : 'not valid';
    if (age === null) return `${validity}; no slip so far`;
    return slip ? `${validity}; slip since ${seconds(age)}` : `${validity}; last slip began ${seconds(age)} ago`;
  }

  // lines: [level, name, message] of each diagnostic.
  showDiagnostics(lines) {
    const key = JSON.stringify(lines);
    if (key === this.diagnosed) return;
    this.diagnosed = key;
    this.diagnostics.replaceChildren(...lines.map(([level, name, message]) => build(`li.level-${level}`,
      build('span.mark', MARKS[level] ?? '?', {role: 'img', ariaLabel: LEVELS[level] ?? 'unknown'}),
      ` ${name}: ${message}`)));
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

  showChannel(channel) {
    this.canvas.title = channel && this.channels ? this.wordsOf(channel) : '';
  }

  wordsOf(channel) {
    const {level, on, valid, disabled} = this.channels[channel - 1];
    const group = Object.entries(this.finger.groups).find(([, members]) => members.includes(channel));
    const state = disabled ? 'disabled' : valid ? `${ratioWords(level)} of the threshold${on ? ', ON' : ''}` : 'not valid';
    return [this.finger.channels[channel - 1], group && `group ${group[0]}`, state].filter(Boolean).join(', ');
  }
}

const ratioWords = (level) => (level < 0.005 ? 'less than 0.01' : level.toPrecision(2));

function voteWords(vote) {
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

// ---- the picture

const QUIET_FILL = '#e6eaed', LEVEL_FILL = '#74828d', FRAME = '#7a858e', DISABLED_FILL = '#d3d7da';

// Where taxels are drawn, in pixels: for each channel {x, y, side}, x and y of its middle.
// positions: [x, y, z] in metres of each channel, no two the same. The two axes along which the finger
// is largest are shown. margin: pixels that stay free around them.
function placesOf(positions, width, height, margin = 0) {
  const extents = [0, 1, 2].map((axis) => {
    const along = positions.map((position) => position[axis]);
    const [least, most] = [Math.min(...along), Math.max(...along)];
    return {axis, least, size: most - least};
  });
  const thinnest = extents.reduce((found, extent) => (extent.size <= found.size ? extent : found));
  const [across, along] = extents.filter((extent) => extent !== thinnest);
  const points = positions.map((position) => [across, along].map(({axis, least}) => position[axis] - least));
  const pitch = smallestDistance(points) || Math.max(across.size, along.size) || 1;
  // The outermost taxels have half a pitch to the edge.
  const scale = Math.min((width - 2 * margin) / (across.size + pitch), (height - 2 * margin) / (along.size + pitch));
  const side = Math.min(0.96 * scale * pitch - 1, 56);
  return points.map(([x, y]) => ({
    x: width / 2 + scale * (x - across.size / 2), y: height / 2 - scale * (y - along.size / 2), side,
  }));
}

// The distance of the closest taxels. As these are drawn as squares, the distance of two is the larger
// of those along the axes.
function smallestDistance(points) {
  const distances = points.flatMap(([x, y], i) => (
    points.slice(0, i).map(([other, above]) => Math.max(Math.abs(x - other), Math.abs(y - above)))));
  return distances.length ? distances.reduce((a, b) => Math.min(a, b)) : 0;
}

// How high a level stands in its taxel: 0 at 1/32 of the threshold or less, 1 at the threshold.
const fillOf = (level) => Math.max(0, Math.min(1, 1 + Math.log2(level) / LEVEL_OCTAVES));

// The content of a picture, as text: while it is the same, nothing has to be painted.
function pictureOf(places, states, marked) {
  const taxels = states.map(({level, on, valid, disabled}, c) => {
    if (disabled) return 'd';
    if (!valid) return 'x';
    return on ? 'o' : Math.round(2 * places[c].side * fillOf(level));
  });
  return `${taxels} ${[...marked]}`;
}

// Draw all taxels of a finger. states[c]: {level, on, valid, disabled}, level as a ratio to the
// threshold. marked: a set of channels, counted from 1, that are framed.
function paintFinger(context, places, states, marked) {
  places.forEach((place, c) => {
    paintTaxel(context, place, states[c], c + 1);
    if (marked.has(c + 1)) {
      const {x, y, side} = place, reach = side / 2 + 3;
      context.strokeStyle = '#0072b2';
      context.lineWidth = 2;
      context.setLineDash([3, 2]);
      context.strokeRect(x - reach, y - reach, 2 * reach, 2 * reach);
      context.setLineDash([]);
    }
  });
}

function paintTaxel(context, {x, y, side}, {level, on, valid, disabled}, number) {
  const left = x - side / 2, top = y - side / 2;
  const shape = new Path2D();
  shape.roundRect(left, top, side, side, side / 5);
  context.fillStyle = disabled ? DISABLED_FILL : '#fff';
  context.fill(shape);
  if (!disabled && !valid) {
    context.fillStyle = hatching(context);
    context.fill(shape);
  } else if (!disabled) {
    context.fillStyle = on ? ON : QUIET_FILL;
    context.fill(shape);
    const high = side * fillOf(level);
    if (!on && high > 0) {
      context.save();
      context.clip(shape);
      context.fillStyle = LEVEL_FILL;
      context.fillRect(left, top + side - high, side, high);
      context.restore();
    }
  }
  if (!disabled) {
    context.strokeStyle = on ? '#000' : FRAME;
    context.lineWidth = on ? Math.min(3, Math.max(1.5, side / 8)) : 1;
    context.stroke(shape);
  }
  if (side < 17) return;
  if (!disabled && !valid) cross(context, x, y, side * 0.36);
  const size = Math.min(13, side / 2);
  context.font = `${on ? 700 : 500} ${size}px system-ui, 'DejaVu Sans', sans-serif`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  // Dark letters with a light outline are legible on any fill; on the colour of ON they need none.
  if (!on) {
    context.strokeStyle = 'rgba(255, 255, 255, 0.92)';
    context.lineWidth = 3.5;
    context.lineJoin = 'round';
    context.strokeText(number, x, y);
  }
  context.fillStyle = disabled ? '#545b61' : '#000';
  context.fillText(number, x, y);
}

function cross(context, x, y, reach) {
  context.strokeStyle = '#8f1111';
  context.lineWidth = 2.5;
  context.beginPath();
  for (const sign of [-1, 1]) {
    context.moveTo(x - reach, y - sign * reach);
    context.lineTo(x + reach, y + sign * reach);
  }
  context.stroke();
}
