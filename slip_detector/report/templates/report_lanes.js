// The lanes of a report's timeline, and the strip of the whole recording above them.

const KINDS = [['false alarm', '\u25bc', '#d55e00'], ['missed', '\u2715', '#a3347f'],
  ['late', '\u25c6', '#e69f00'], ['detected', '\u25cf', '#009e73']];
const LISTED = 200, THRESHOLD_CODE = 128, CODES_OF_OCTAVE = 16;
// The range of the codes of levels that a lane shows.
const LEVEL_CODES = [-1, 1].map((sign) => THRESHOLD_CODE + sign * CODES_OF_OCTAVE * LEVEL_OCTAVES);
// The range of the codes of floor and excess that a lane shows: all of them.
const DECIBEL_CODES = [1, 255];
const root = element('timeline'), minimap = element('minimap');
const header = JSON.parse(element('header').textContent);
const recordings = header.recordings.map(() => null);
const names = header.variants;
const view = {recording: 0, variant: names.length - 1, from: 0, to: 1, chosen: null};
const shown = new Set([0, 1, 2]);
let listed = LISTED, pending = false, drawn = null;

const now = () => header.recordings[view.recording];
const duration = () => now().rows / now().rate_hz;
const eventsOf = (r, v = view.variant) => header.recordings[r].variants[v].events;

function load(r) {
  recordings[r] ??= inflate(element(`data-${r}`).textContent)
    .then((bytes) => decode(header.recordings[r], bytes));
  return recordings[r];
}

function fail(text) {
  element('failure').hidden = false;
  element('failure').textContent = text;
}

// ---- text

function clock(seconds, step = 0.001) {
  const digits = step >= 1 ? 0 : Math.min(3, Math.ceil(-Math.log10(step) - 1e-9));
  if (duration() < 120) return `${seconds.toFixed(digits)} s`;
  const total = Number(seconds.toFixed(digits)), minutes = Math.floor(total / 60);
  const rest = (total - 60 * minutes).toFixed(digits).padStart(digits ? digits + 3 : 2, '0');
  if (duration() < 3600) return `${minutes}:${rest}`;
  return `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, '0')}:${rest}`;
}

function ratio(code) {
  if (code === 0) return 'not valid';
  const octaves = (code - THRESHOLD_CODE) / CODES_OF_OCTAVE;
  return `${code === 1 ? '\u2264 ' : ''}${(2 ** octaves).toPrecision(2)}`;
}

// The decibels of a code of excess or floor, and back.
function decibels(name, code) {
  const [low, high] = now().variants[view.variant].ranges_db[name];
  return low + (code - 1) / 254 * (high - low);
}

function codeOf(name, value) {
  const [low, high] = now().variants[view.variant].ranges_db[name];
  return 1 + 254 * (value - low) / (high - low);
}

// The signal that channels show: the chosen one, or the level where the variant lacks that signal.
function signalShown() {
  const chosen = element('signal').value;
  const known = chosen === 'volts' || now().variants[view.variant].signals.includes(chosen);
  return known ? chosen : 'level';
}

// A text on the range of decibels in which a lane shows excess or floor.
function scaleOfDecibels() {
  const name = signalShown(), {ranges_db: ranges, offset_db: offset} = now().variants[view.variant];
  if (!ranges?.[name]) return '';
  const [low, high] = ranges[name].map((value) => value.toFixed(1));
  const line = name === 'excess' ? `, with a line at ${offset.toFixed(1)} dB, above which evidence grows` : '';
  return `The ${name} is drawn from ${low} to ${high} dB${line}. `;
}

function showScale() {
  element('resolution').textContent = scaleOfDecibels() + resolution();
}

// A text on the resolution of the drawing.
function resolution() {
  const {bin_rows: bin, rate_hz: rate} = now(), events = eventsOf(view.recording);
  const grouped = new Set(now().variants.flatMap((v) => v.groups.flatMap((group) => group.members)));
  const disabled = now().channels.length - grouped.size;
  const without = disabled ? ` Disabled channels, ${disabled} of them, are left out.` : '';
  if (bin === 1) return `Each row is drawn when zoomed in.${without}`;
  const snippets = now().variants[view.variant].snippets;
  const fine = events.filter(([, start]) => snippets.some(
    ([first, rows]) => start * rate >= first - 0.5 && start * rate < first + rows)).length;
  return `Drawn from the lowest and highest of each ${(1e3 * bin / rate).toFixed(0)} ms; `
    + `row by row about the start of ${fine} of ${events.length} events.${without}`;
}

// ---- lanes, from top to bottom

function lanesOf(data, found) {
  const recording = now(), variant = data.variants[view.variant];
  const {groups} = recording.variants[view.variant];
  const grouped = recording.variants.flatMap((v) => v.groups.flatMap((group) => group.members));
  const left = new Set(grouped.map((member) => member - 1));
  const free = window.innerHeight - 330;
  const height = Math.max(18, Math.min(60, Math.floor(free / Math.max(left.size, 1))));
  const intervals = (rows, color) => (pen, lane) => (
    bars(pen, xOfRow(pen), rows, lane.top, lane.height - 1, color));
  const channel = (c, name) => ({
    name, height, channel: c, className: 'channel', curve: true, below: STRIP + 3, paint: paintStrip(found),
  });
  const lanes = [{name: 'events', height: 16, paint: paintEvents}];
  if (data.truth) lanes.push({name: 'label', height: 16, paint: intervals(data.truth, LABEL)});
  names.forEach((name, v) => lanes.push({
    name: names.length > 1 ? `slip ${name}` : 'slip', height: 16, paint: intervals(data.variants[v].slip, ON),
  }));
  if (variant.afterImpact.length) {
    lanes.push({name: 'after impact', height: 16, paint: intervals(variant.afterImpact, '#8d99a3')});
  }
  groups.forEach((group, g) => {
    const decisions = intervals(variant.groups[g], GROUP_ON);
    lanes.push({
      name: group.name, height: 14, className: 'group',
      paint: (pen, lane) => {
        decisions(pen, lane);
        pen.context.fillStyle = '#aeb6bc';
        pen.context.fillRect(pen.left, lane.top - 1, pen.right - pen.left, 1);
      },
    });
    for (const member of group.members) {
      left.delete(member - 1);
      lanes.push(channel(member - 1, recording.channels[member - 1]));
    }
  });
  // Channels that only this variant has disabled.
  for (const c of left) lanes.push(channel(c, `${recording.channels[c]} (off)`));
  return lanes;
}

const xOfRow = (pen) => (row) => pen.xOf(row / now().rate_hz);

function paintEvents({context, xOf}, lane) {
  const y = lane.top + lane.height / 2;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  const events = eventsOf(view.recording);
  // The most important kinds are drawn last, on top of the others.
  for (let kind = KINDS.length - 1; kind >= 0; kind--) {
    context.fillStyle = KINDS[kind][2];
    context.font = `${kind === 3 ? 9 : 13}px system-ui, sans-serif`;
    for (const event of events) {
      if (event[0] === kind && event[1] >= view.from - 1 && event[1] <= view.to + 1) {
        context.fillText(KINDS[kind][1], xOf(event[1]), y);
      }
    }
  }
}

// Paint the strip under a channel's curve that shows how near the channel is to its threshold.
const paintStrip = (found) => (pen, lane) => {
  const {context, right, left} = pen, xOf = xOfRow(pen);
  const y = lane.top + lane.height - STRIP - 1;
  // The code of a line in the lane, and the lane's range: above the line a level is ON, or an excess
  // adds to the evidence.
  const marks = {
    level: () => [THRESHOLD_CODE, LEVEL_CODES],
    excess: () => [codeOf('excess', now().variants[view.variant].offset_db), DECIBEL_CODES],
  };
  const mark = marks[signalShown()];
  if (mark) {
    const [code, [low, high]] = mark(), top = lane.top + 1, bottom = lane.top + lane.height - lane.below;
    context.fillStyle = '#c9a28c';
    context.fillRect(left, bottom - (bottom - top) * (code - low) / (high - low), right - left, 1);
  }
  for (const {row, rows, n, first, stop, signals: {level: levels}} of found) {
    const colorAt = (i) => {
      const code = levels[lane.channel * n + i];
      return code === 0 ? hatching(context) : shade((code - THRESHOLD_CODE) / CODES_OF_OCTAVE);
    };
    paintRuns(context, y, STRIP, first, stop, colorAt, (i) => xOf(row + i * rows));
  }
};

const paintUnderAll = (data) => (pen) => {
  const {context, xOf, top, bottom} = pen;
  context.fillStyle = '#fff';
  context.fillRect(pen.left, top, pen.right - pen.left, bottom - top);
  if (data.truth) bars(pen, xOfRow(pen), data.truth, top, bottom - top, '#e8f2f9');
  if (!view.chosen) return;
  const [, start, end, latency] = view.chosen;
  const {top: upper, height} = timeline.lanes[0];
  context.fillStyle = '#fff3c4';
  context.fillRect(xOf(start), 0, Math.max(xOf(end) - xOf(start), 1), upper + height);
  const line = (seconds, dash) => {
    context.setLineDash(dash);
    context.beginPath();
    context.moveTo(xOf(seconds), 0);
    context.lineTo(xOf(seconds), bottom);
    context.stroke();
  };
  context.strokeStyle = INK;
  context.lineWidth = 1;
  line(start, []);
  if (latency !== null) line(start + latency, [4, 3]);
};

// ---- drawing

function redraw() {
  if (pending) return;
  pending = true;
  root.ariaBusy = 'true';
  requestAnimationFrame(async () => {
    pending = false;
    const r = view.recording;
    try {
      const data = await load(r);
      if (r === view.recording) draw(data);
    } catch (error) {
      fail(`${header.recordings[r].name} cannot be drawn: ${error.message}`);
      throw error;
    }
  });
}

function draw(data) {
  const {rate_hz: rate, step_v: step} = now(), {from, to} = view;
  const width = Math.max(root.clientWidth - NAMES_WIDTH - RIGHT_MARGIN, 1);
  const rowsOfPixel = (to - from) * rate / width;
  const found = pieces(now(), data, view.variant, from * rate, to * rate, rowsOfPixel);
  const lanes = lanesOf(data, found), channels = lanes.filter((lane) => lane.curve);
  const curves = channels.map((lane) => curve(found, lane.channel));
  if (signalShown() === 'volts') {
    const span = ([low, high], c) => step[c] * (high - low);
    const widest = Math.max(...curves.map(({range}, i) => span(range, channels[i].channel)));
    channels.forEach((lane, i) => {
      if (!curves[i].known) return;
      const [low, high] = curves[i].range, middle = (low + high) / 2, c = lane.channel;
      const half = element('same-scale').checked ? widest / step[c] / 2 : (high - low) / 2;
      // A curve that is flat lies in the middle of its lane.
      curves[i].range = half ? [middle - half, middle + half] : [middle - 1, middle + 1];
      lane.note = volts(2 * half * step[c]);
    });
  }
  timeline.setLanes(lanes);
  const starts = startsOf(found);
  drawn = {found, starts};
  timeline.draw({
    from, to, curves, x: starts.map((row) => row / rate), paint: paintUnderAll(data),
    steps: found.some(({rows}) => rows > 3 * rowsOfPixel),
  });
  drawMinimap(data);
  Object.assign(root.dataset, {
    fromS: from, toS: to, recording: view.recording, variant: view.variant,
  });
  root.ariaBusy = String(pending);
  document.documentElement.dataset.readyMs ??= performance.now();
}

// The curve of a channel in view, and the range of codes that its lane shows.
function curve(found, channel) {
  const signal = signalShown();
  if (signal !== 'volts') {
    const range = signal === 'level' ? LEVEL_CODES : DECIBEL_CODES, [least, most] = range;
    const code = (value) => (value ? Math.max(least, Math.min(most, value)) : null);
    const values = ({signals}) => [signals[signal], signals[signal]];
    return {...curveOf(found, channel, values, code), range};
  }
  let least = Infinity, most = -Infinity;
  const values = curveOf(found, channel, ({low, high}) => [low, high], (value) => {
    if (value === NO_SAMPLE) return null;
    if (value < least) least = value;
    if (value > most) most = value;
    return value;
  });
  return most < least ? {...values, range: [0, 1], known: false} : {...values, range: [least, most], known: true};
}

function drawMinimap(data) {
  const ratio = window.devicePixelRatio || 1, width = minimap.clientWidth, height = minimap.clientHeight;
  Object.assign(minimap, {width: Math.round(width * ratio), height: Math.round(height * ratio)});
  const context = minimap.getContext('2d');
  context.scale(ratio, ratio);
  const pen = {context, left: NAMES_WIDTH, right: width - RIGHT_MARGIN};
  const xOf = (seconds) => pen.left + seconds * (pen.right - pen.left) / duration();
  const xOfRows = (row) => xOf(row / now().rate_hz);
  context.fillStyle = '#f3f4f5';
  context.fillRect(pen.left, 0, pen.right - pen.left, height);
  if (data.truth) bars(pen, xOfRows, data.truth, 0, height, TRUTH);
  bars(pen, xOfRows, data.variants[view.variant].slip, height * 0.55, height * 0.45, ON);
  for (const event of eventsOf(view.recording)) {
    if (event[0] === 3) continue;
    context.fillStyle = KINDS[event[0]][2];
    context.fillRect(xOf(event[1]) - 1, 0, 2, height * 0.5);
  }
  const from = xOf(view.from), to = Math.max(xOf(view.to), from + 2);
  context.fillStyle = 'rgba(60, 70, 80, 0.25)';
  context.fillRect(pen.left, 0, from - pen.left, height);
  context.fillRect(to, 0, pen.right - to, height);
  context.strokeStyle = INK;
  context.strokeRect(from + 0.5, 0.5, to - from - 1, height - 1);
}
