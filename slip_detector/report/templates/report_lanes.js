'use strict';
// A report's timeline: its data, which page.py encodes, and what is drawn of them.

const NO_SAMPLE = 0xffff;
const KINDS = [['false alarm', '\u25bc', '#d55e00'], ['missed', '\u2715', '#a3347f'],
  ['late', '\u25c6', '#e69f00'], ['detected', '\u25cf', '#009e73']];
const DETECTED = 3;
// The code of a level that equals the threshold, and the range of codes that a lane of levels shows.
const THRESHOLD_CODE = 128, CODES_OF_OCTAVE = 16;
const LEVEL_CODES = [-1, 1].map((sign) => THRESHOLD_CODE + sign * CODES_OF_OCTAVE * LEVEL_OCTAVES);
const root = element('timeline');
const header = JSON.parse(element('header').textContent);
const recordings = header.recordings.map(() => null);
const names = header.variants;
const view = {recording: 0, variant: names.length - 1, from: 0, to: 1, chosen: null};
const shown = new Set([0, 1, 2]);
let pending = false, drawn = null;

const now = () => header.recordings[view.recording];
const variantNow = () => now().variants[view.variant];
const duration = () => now().rows / now().rate_hz;
const eventsOf = (r) => header.recordings[r].variants[view.variant].events;

// ---- data

function load(r) {
  recordings[r] ??= inflate(element(`data-${r}`).textContent).then((bytes) => decode(header.recordings[r], bytes));
  return recordings[r];
}

async function inflate(base64) {
  const text = atob(base64.trim()), bytes = new Uint8Array(text.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function decode({channels: {length: channels}, bins, bin_rows: binRows, variants}, bytes) {
  let at = 0;
  const next = (n) => bytes.subarray(at, at += n);
  const voltsOf = (rows) => {
    const low = next(channels * rows), high = next(channels * rows), codes = new Uint16Array(low.length);
    for (let i = 0; i < codes.length; i++) codes[i] = low[i] | (high[i] << 8);
    return codes;
  };
  const signalsOf = ({signals}, rows) => each(Object.keys(signals), () => next(channels * rows));
  // A bin without samples has the code NO_SAMPLE, the highest one, in both.
  const higherVolts = (a, b) => (a === NO_SAMPLE ? b : b === NO_SAMPLE || a > b ? a : b);
  const low = voltsOf(bins), high = binRows > 1 ? voltsOf(bins) : low;
  return {
    low: halved(low, channels, bins, Math.min),
    high: halved(high, channels, bins, higherVolts),
    variants: variants.map((variant) => {
      const signals = signalsOf(variant, bins);
      return {
        signals: each(Object.keys(signals), (name) => halved(signals[name], channels, bins, Math.max)),
        snippets: variant.snippets.map(([start, rows]) => (
          {start, rows, volts: voltsOf(rows), signals: signalsOf(variant, rows)})),
      };
    }),
  };
}

// An object with of(name) for each name, in the order of the names.
function each(keys, of) {
  return Object.fromEntries(keys.map((name) => [name, of(name)]));
}

// The values in all resolutions: as they are, then joined in twos, in fours and so on; in each the
// channels follow one another.
function halved(values, channels, n, join) {
  if (n <= 512) return [{values, n}];
  const half = Math.ceil(n / 2), next = new values.constructor(channels * half).map((_, k) => {
    const c = Math.floor(k / half), i = c * n + 2 * (k - c * half);
    return join(values[i], values[Math.min(i + 1, c * n + n - 1)]);
  });
  return [{values, n}, ...halved(next, channels, half, join)];
}

// The pieces to draw between two rows: single rows where they were kept, else bins of about a pixel.
// A piece: {row, rows, n, first, stop, low, high, signals}. Its value i begins at row + i * rows and
// spans that number of rows; the values from first up to stop are drawn. low, high and each of
// signals have n values for each channel; those of a channel begin at channel * n.
function pieces(data, from, to, rowsOfPixel) {
  const {bin_rows: binRows} = now(), level = Math.max(0, Math.ceil(Math.log2(rowsOfPixel / binRows)));
  const size = Math.min(level, data.low.length - 1), rows = binRows * 2 ** size;
  const {signals, snippets} = data.variants[view.variant], found = [];
  // One more value at either end, so that curves reach the edge.
  [from, to] = [from - rows, to + rows];
  const bins = (start, end) => {
    const {values: low, n} = data.low[size], high = data.high[size].values;
    const first = Math.max(0, Math.floor(start / rows)), stop = Math.min(n, Math.ceil(end / rows));
    const its = each(Object.keys(signals), (name) => signals[name][size].values);
    if (stop > first) found.push({row: 0, rows, n, first, stop, low, high, signals: its});
  };
  let at = from;
  for (const {start: row, rows: n, volts: low, signals: codes} of rows > 1 && size === 0 ? snippets : []) {
    if (row + n <= from || row >= to) continue;
    if (row > at) bins(at, row);
    const first = Math.max(0, Math.floor(from) - row - 1), stop = Math.min(n, Math.ceil(to) - row + 1);
    found.push({row, rows: 1, n, first, stop, low, high: low, signals: codes});
    at = row + n;
  }
  if (at < to) bins(at, to);
  return found;
}

// The rows at which the values of pieces begin, and the row after the last value.
function startsOf(found) {
  const starts = [];
  let end = 0;
  for (const {row, rows, first, stop} of found) {
    // A bin that begins before its piece is drawn from the beginning of the piece on.
    for (let i = first; i < stop; i++) starts.push(Math.max(row + i * rows, end));
    end = row + stop * rows;
  }
  return [...starts, end];
}

// A channel's curve in view, as Timeline.draw takes it, and the range of codes that it has.
function curve(found, channel) {
  const signal = signalShown(), rows = [], low = [], high = [];
  const [least, most] = signal === 'level' ? LEVEL_CODES : [1, 255];
  const code = (value) => {
    if (signal === 'volts') return value === NO_SAMPLE ? null : value;
    return value ? Math.max(least, Math.min(most, value)) : null;
  };
  for (const piece of found) {
    const [lows, highs] = signal === 'volts' ? [piece.low, piece.high] : Array(2).fill(piece.signals[signal]);
    for (let i = piece.first, k = channel * piece.n + i; i < piece.stop; i++, k++) {
      const from = code(lows[k]), to = code(highs[k]), single = piece.rows === 1;
      rows.push(single ? from : null);
      low.push(single ? null : from);
      high.push(single ? null : to);
    }
  }
  // Repeated at its end, the last bin is drawn in its full length.
  for (const values of [low, high]) values.push(values.at(-1) ?? null);
  rows.push(null);
  return {rows, low, high, range: signal === 'volts' ? rangeOf([rows, low, high].flat()) : [least, most]};
}

// ---- text

function clock(seconds, digits = 3) {
  if (duration() < 120) return `${seconds.toFixed(digits)} s`;
  const time = new Date(Math.round(1000 * Number(seconds.toFixed(digits)))).toISOString();
  return time.slice(duration() < 3600 ? 14 : 11, digits ? 20 + digits : 19);
}

// What is at a code of a signal, in words; its value is octaves above the threshold, or decibels.
function wordsOf(signal, code) {
  const [low, high] = variantNow().signals[signal], value = low + (code - 1) / 254 * (high - low);
  if (signal !== 'level') return `${signal} ${value.toFixed(1)} dB`;
  const ratio = `${code === 1 ? '\u2264 ' : ''}${(2 ** value).toPrecision(2)}`;
  return `level / threshold ${code ? ratio : 'not valid'}`;
}

// The signal that channels show: the chosen one, or the level where the variant lacks that signal.
function signalShown() {
  const chosen = element('signal').value;
  return chosen === 'volts' || chosen in variantNow().signals ? chosen : 'level';
}

// Say on what scale and how finely channels are drawn.
function showScale() {
  const {bin_rows: bin, rate_hz: rate, channels, variants} = now(), {signals, offset_db: offset, snippets} = variantNow();
  const signal = signalShown(), words = [];
  if (signal === 'excess' || signal === 'floor') {
    const [low, high] = signals[signal].map((value) => value.toFixed(1));
    const line = signal === 'excess' ? `, with a line at ${offset.toFixed(1)} dB, above which evidence grows` : '';
    words.push(`The ${signal} is drawn from ${low} to ${high} dB${line}.`);
  }
  const events = eventsOf(view.recording);
  const fine = events.filter(([, start]) => snippets.some(
    ([first, rows]) => start * rate >= first - 0.5 && start * rate < first + rows)).length;
  words.push(bin === 1 ? 'Each row is drawn when zoomed in.'
    : `Drawn from the lowest and highest of each ${(1e3 * bin / rate).toFixed(0)} ms; `
      + `row by row about the start of ${fine} of ${events.length} events.`);
  const disabled = channels.length - groupedChannels(variants).size;
  if (disabled) words.push(`Disabled channels, ${disabled} of them, are left out.`);
  element('resolution').textContent = words.join(' ');
}

const groupedChannels = (variants) => new Set(
  variants.flatMap(({groups}) => groups.flatMap(({members}) => members.map((member) => member - 1))));

// ---- lanes, from top to bottom

function lanesOf(found) {
  const {channels, truth, variants} = now(), left = groupedChannels(variants);
  const height = Math.max(18, Math.min(60, Math.floor((window.innerHeight - 330) / Math.max(left.size, 1))));
  const intervals = (rows, color) => (pen, lane) => bars(pen, xOfRow(pen), rows, lane.top, lane.height - 1, color);
  const channel = (c, name) => ({
    name, height, channel: c, kind: 'channel', curve: true, below: STRIP + 3, paint: paintStrip(found),
  });
  const lanes = [{name: 'events', height: 16, paint: paintEvents},
    {name: 'label', height: 16, paint: intervals(truth, LABEL)}];
  variants.forEach(({slip}, v) => lanes.push(
    {name: names.length > 1 ? `slip ${names[v]}` : 'slip', height: 16, paint: intervals(slip, ON)}));
  const {after_impact: afterImpact, groups} = variantNow();
  if (afterImpact.length) lanes.push({name: 'after impact', height: 16, paint: intervals(afterImpact, '#8d99a3')});
  for (const {name, on, members} of groups) {
    lanes.push({name, height: 14, kind: 'group', paint: intervals(on, GROUP_ON)});
    for (const c of members.map((member) => member - 1)) {
      left.delete(c);
      lanes.push(channel(c, channels[c]));
    }
  }
  // Channels that only this variant has disabled.
  for (const c of left) lanes.push(channel(c, `${channels[c]} (off)`));
  return lanes;
}

const xOfRow = (pen) => (row) => pen.xOf(row / now().rate_hz);

function paintEvents({context, xOf}, lane) {
  Object.assign(context, {textAlign: 'center', textBaseline: 'middle'});
  // The most important kinds are drawn last, on top of the others.
  for (const [kind, start] of [...eventsOf(view.recording)].sort((a, b) => b[0] - a[0])) {
    if (start < view.from - 1 || start > view.to + 1) continue;
    context.fillStyle = KINDS[kind][2];
    context.font = `${kind === DETECTED ? 9 : 13}px system-ui, sans-serif`;
    context.fillText(KINDS[kind][1], xOf(start), lane.top + lane.height / 2);
  }
}

// Paint the strip under a channel's curve that shows how near the channel is to its threshold.
const paintStrip = (found) => (pen, lane) => {
  const {context, right, left} = pen, xOf = xOfRow(pen), signal = signalShown();
  const top = lane.top + 1, bottom = lane.top + lane.height - lane.below;
  // Above this line a level is ON, or an excess adds to the evidence.
  const {signals: {excess: [low, high] = []}, offset_db: offset} = variantNow();
  const share = {level: 0.5, excess: (offset - low) / (high - low)}[signal];
  context.fillStyle = '#c9a28c';
  if (share !== undefined) context.fillRect(left, bottom - (bottom - top) * share, right - left, 1);
  for (const {row, rows, n, first, stop, signals: {level: levels}} of found) {
    const colorAt = (i) => {
      const code = levels[lane.channel * n + i];
      return code ? shade((code - THRESHOLD_CODE) / CODES_OF_OCTAVE) : HATCHING;
    };
    paintRuns(context, lane.top + lane.height - STRIP - 1, STRIP, first, stop, colorAt, (i) => xOf(row + i * rows));
  }
};

function paintUnderAll(pen) {
  const {context, xOf, top, bottom} = pen;
  bars(pen, xOfRow(pen), now().truth, top, bottom - top, '#e8f2f9');
  if (!view.chosen) return;
  const [, start, end, latency] = view.chosen, {top: upper, height} = timeline.lanes[0];
  context.fillStyle = '#fff3c4';
  context.fillRect(xOf(start), 0, Math.max(xOf(end) - xOf(start), 1), upper + height);
  context.fillStyle = INK;
  context.fillRect(xOf(start), 0, 1, bottom);
  // The alarm's line is dashed.
  for (let y = 0; latency !== null && y < bottom; y += 7) context.fillRect(xOf(start + latency), y, 1, 4);
}

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
      const text = `${header.recordings[r].name} cannot be drawn: ${error.message}`;
      Object.assign(element('failure'), {hidden: false, textContent: text});
      throw error;
    }
  });
}

function draw(data) {
  const {rate_hz: rate, step_v: step} = now(), {from, to} = view;
  const width = Math.max(root.clientWidth - NAMES_WIDTH - RIGHT_MARGIN, 1);
  const rowsOfPixel = (to - from) * rate / width;
  const found = pieces(data, from * rate, to * rate, rowsOfPixel), starts = startsOf(found);
  const lanes = lanesOf(found), channels = lanes.filter((lane) => lane.curve);
  const curves = channels.map((lane) => curve(found, lane.channel));
  if (signalShown() === 'volts') {
    const spans = curves.map(({range}, i) => (range ? step[channels[i].channel] * (range[1] - range[0]) : 0));
    const widest = Math.max(...spans);
    channels.forEach((lane, i) => {
      const {range} = curves[i], span = element('same-scale').checked ? widest : spans[i];
      // A curve that is flat lies in the middle of its lane; one without samples anywhere.
      const half = span / step[lane.channel] / 2 || 1, middle = range ? (range[0] + range[1]) / 2 : 0;
      curves[i].range = [middle - half, middle + half];
      if (range) lane.note = volts(span);
    });
  }
  timeline.setLanes(lanes);
  drawn = {found, starts};
  timeline.draw({
    from, to, curves, x: starts.map((row) => row / rate), paint: paintUnderAll,
    steps: found.some(({rows}) => rows > 3 * rowsOfPixel),
  });
  Object.assign(root.dataset, {fromS: from, toS: to, recording: view.recording, variant: view.variant});
  root.ariaBusy = String(pending);
  document.documentElement.dataset.readyMs ??= performance.now();
}
