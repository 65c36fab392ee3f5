// A report's timeline: its data, which page.py encodes, and what is drawn of them.

const KINDS = [
  ['missed', '\u2715', '#a3347f'], ['false alarm', '\u25bc', '#d55e00'],
  ['late', '\u25c6', '#e69f00'], ['detected', '\u25cf', '#009e73'], ['onset', '\u25bc', '#0072b2'],
];
const DETECTED = 3, ONSET = 4;
// The code of a level at the threshold, and the range of codes that a lane of levels shows.
const THRESHOLD_CODE = 128, CODES_OF_OCTAVE = 16;
const LEVEL_CODES = [-1, 1].map((sign) => THRESHOLD_CODE + sign * CODES_OF_OCTAVE * LEVEL_OCTAVES);
const root = element('timeline');
const header = JSON.parse(element('header').textContent);
const recordings = header.recordings.map(() => null);
const names = header.variants;
const view = {recording: 0, variant: names.length - 1, from: 0, to: 1, chosen: null};
let pending = false, drawn = null;

const now = () => header.recordings[view.recording];
const variantNow = () => now().variants[view.variant];
const duration = () => now().rows / now().rate_hz;
const eventsOf = (r) => header.recordings[r].variants[view.variant].events;
// All events, each with the numbers of its recording and of itself.
const everyEvent = () => header.recordings.flatMap(
  (_, r) => eventsOf(r).map((event, i) => [r, i, event]));

async function load(r) {
  const text = atob(header.recordings[r].data.trim()), bytes = new Uint8Array(text.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  return decode(header.recordings[r], new Uint8Array(await new Response(stream).arrayBuffer()));
}

// A channel's curve in view, as Timeline.draw takes it, and the range of codes that it has.
function curve({rows, n, first, stop, ...bins}, channel) {
  const isVolts = signalShown() === 'volts', none = isVolts ? NO_SAMPLE : 0;
  const [low, high] = ['low', 'high'].map((end) => {
    const codes = isVolts ? bins[end] : bins.codes, begin = channel * n;
    const seen = Array.from(codes.subarray(begin + first, begin + stop));
    const values = seen.map((code) => (code === none ? null : code));
    // Repeated at its end, the last bin is drawn in its full length.
    return [...values, rows > 1 ? values.at(-1) ?? null : null];
  });
  const range = isVolts ? rangeOf([...low, ...high]) : LEVEL_CODES;
  return {low, high: rows > 1 ? high : low, range};
}

function clock(seconds, digits = 3) {
  if (duration() < 120) return `${seconds.toFixed(digits)} s`;
  return timeText(Number(seconds.toFixed(digits)), digits).slice(duration() < 3600 ? 3 : 0);
}

function wordsOf(code) {
  const ratio = (2 ** ((code - THRESHOLD_CODE) / CODES_OF_OCTAVE)).toPrecision(2);
  return `level / threshold ${code ? (code === 1 ? '\u2264 ' : '') + ratio : 'not valid'}`;
}

const signalShown = () => element('signal').value;

function showScale() {
  const {bin_rows: bin, rate_hz: rate, channels} = now(), {groups} = variantNow();
  const disabled = channels.length - new Set(groups.flatMap(({members}) => members)).size;
  const left = disabled ? ` Disabled channels, ${disabled} of them, are left out.` : '';
  const each = `the lowest and highest of each ${(1e3 * bin / rate).toFixed(0)} ms`;
  const how = bin === 1 ? 'Each row is drawn when zoomed in.' : `Drawn from ${each}.`;
  element('resolution').textContent = how + left;
}

function lanesOf(bins) {
  const {channels, truth, variants} = now(), {groups} = variantNow();
  const n = groups.flatMap(({members}) => members).length;
  const height = clamp(Math.floor((window.innerHeight - 330) / Math.max(n, 1)), 18, 60);
  const intervals = (rows, color) => (pen, lane) => (
    bars(pen.context, xOfRow(pen), rows, lane.top, lane.height - 1, color));
  const channel = (c) => ({
    name: channels[c], height, channel: c, kind: 'channel', curve: true, below: STRIP + 3,
    paint: paintStrip(bins),
  });
  const lanes = [{name: 'events', height: 16, paint: paintEvents}];
  if (truth) lanes.push({name: 'label', height: 16, paint: intervals(truth, LABEL)});
  variants.forEach(({slip}, v) => {
    const name = names.length > 1 ? `slip ${names[v]}` : 'slip';
    lanes.push({name, height: 16, paint: intervals(slip, ON)});
  });
  for (const {name, on, members} of groups) {
    lanes.push({name, height: 14, kind: 'group', paint: intervals(on, GROUP_ON)});
    lanes.push(...members.map((member) => channel(member - 1)));
  }
  return lanes;
}

const xOfRow = (pen) => (row) => pen.xOf(row / now().rate_hz);

function paintEvents({context, xOf}, lane) {
  context.textAlign = 'center';
  // The most important kinds are drawn last, on top of the others.
  for (const [kind, start] of [...eventsOf(view.recording)].sort((a, b) => b[0] - a[0])) {
    context.fillStyle = KINDS[kind][2];
    context.font = `${kind === DETECTED ? 9 : 13}px ${FONT}`;
    context.fillText(KINDS[kind][1], xOf(start), lane.top + lane.height / 2);
  }
}

// Paint the strip under a channel's curve that shows how near the channel is to its threshold.
const paintStrip = ({rows, n, first, stop, codes}) => (pen, lane) => {
  const {context, right, left} = pen, xOf = xOfRow(pen);
  const top = lane.top + 1, bottom = lane.top + lane.height - lane.below;
  context.fillStyle = '#c9a28c';
  if (signalShown() === 'level') context.fillRect(left, (top + bottom) / 2, right - left, 1);
  const colorAt = (i) => {
    const code = codes[lane.channel * n + i];
    return code ? shade((code - THRESHOLD_CODE) / CODES_OF_OCTAVE) : HATCHING;
  };
  const strip = lane.top + lane.height - STRIP - 1;
  paintRuns(context, strip, STRIP, first, stop, colorAt, (i) => xOf(i * rows));
};

function paintUnderAll(pen) {
  const {context, xOf, top, bottom} = pen;
  bars(context, xOfRow(pen), now().truth ?? [], top, bottom - top, '#e8f2f9');
  if (!view.chosen) return;
  const [, start, end, latency] = view.chosen, {top: upper, height} = timeline.lanes[0];
  context.fillStyle = '#fff3c4';
  context.fillRect(xOf(start), 0, Math.max(xOf(end) - xOf(start), 1), upper + height);
  context.fillStyle = INK;
  context.fillRect(xOf(start), 0, 1, bottom);
  const alarm = latency === null ? null : xOf(start + latency);
  for (let y = 0; alarm !== null && y < bottom; y += 7) context.fillRect(alarm, y, 1, 4);
}

function redraw() {
  if (pending) return;
  pending = true;
  root.ariaBusy = 'true';
  requestAnimationFrame(async () => {
    pending = false;
    const r = view.recording;
    try {
      const data = await (recordings[r] ??= load(r));
      if (r === view.recording) draw(data);
    } catch (error) {
      const text = `${header.recordings[r].name} cannot be drawn: ${error.message}`;
      Object.assign(element('failure'), {hidden: false, textContent: text});
      throw error;
    }
  });
}

function draw(data) {
  const {rate_hz: rate, step_v: step, bin_rows: binRows} = now(), {from, to} = view;
  const width = Math.max(root.clientWidth - NAMES_WIDTH - RIGHT_MARGIN, 1);
  const ends = [from * rate, to * rate], rowsOfPixel = (to - from) * rate / width;
  const bins = binsBetween(...ends, data, view.variant, binRows, rowsOfPixel);
  const {first, stop, rows} = bins;
  drawn = {...bins, data};
  const lanes = lanesOf(bins), channels = lanes.filter((lane) => lane.curve);
  const curves = channels.map((lane) => curve(bins, lane.channel));
  if (signalShown() === 'volts') {
    channels.forEach((lane, i) => {
      const {range} = curves[i], [least, most] = range ?? [0, 0];
      if (range) lane.note = volts(step[lane.channel] * (most - least));
      // A curve that is flat lies in the middle of its lane; one without samples anywhere.
      if (least === most) curves[i].range = [least - 1, most + 1];
    });
  }
  timeline.setLanes(lanes);
  timeline.draw({
    from, to, curves, paint: paintUnderAll,
    x: Array.from({length: stop - first + 1}, (_, i) => (first + i) * rows / rate),
  });
  const {recording, variant} = view;
  Object.assign(root.dataset, {fromS: from, toS: to, recording, variant});
  root.ariaBusy = String(pending);
  document.documentElement.dataset.readyMs ??= performance.now();
}
