// The timeline: draws what is visible, from top to bottom in lanes.

const KINDS = [['false alarm', '\u25bc', '#d55e00'], ['missed', '\u2715', '#a3347f'],
  ['late', '\u25c6', '#e69f00'], ['detected', '\u25cf', '#009e73']];
const TRUTH = '#b9d7ec', ON = '#d55e00', INK = '#23292e', MUTED = '#6a737b';
const GUTTER = 92, LISTED = 200, THRESHOLD_CODE = 128, STRIP = 4;
const SHADES = Array.from({length: THRESHOLD_CODE + 1}, (_, code) => {
  const far = 1 - Math.max(0, (code - 48) / 80);
  return `rgb(${[95, 109, 119].map((dark) => Math.round(dark + (238 - dark) * far)).join()})`;
});

const element = (id) => document.getElementById(id);
const make = (name, text, className) => {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  if (className) made.className = className;
  return made;
};
const canvas = element('timeline'), minimap = element('minimap');
const header = JSON.parse(element('header').textContent);
const recordings = header.recordings.map(() => null);
const names = header.variants;
const view = {recording: 0, variant: names.length - 1, from: 0, to: 1, chosen: null};
const shown = new Set([0, 1, 2]);
let listed = LISTED, pending = false, hover = null, lanes = [], selection = null;

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

function volts(value) {
  const size = Math.abs(value);
  if (size && (size < 1e-3 || size >= 1e5)) return `${value.toExponential(2)} V`;
  return size < 0.1 ? `${(1e3 * value).toPrecision(3)} mV` : `${value.toPrecision(size >= 1000 ? 6 : 4)} V`;
}

function ratio(code) {
  if (code === 0) return 'not valid';
  const octaves = (code - THRESHOLD_CODE) / 16;
  return `${code === 1 ? '\u2264 ' : ''}${(2 ** octaves).toPrecision(2)}`;
}

// How fine the drawing can be.
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

// ---- lanes: what is drawn from top to bottom

function layOut() {
  const recording = now(), groups = recording.variants[view.variant].groups;
  const free = window.innerHeight - 330;
  const grouped = recording.variants.flatMap((v) => v.groups.flatMap((group) => group.members));
  const left = new Set(grouped.map((member) => member - 1));
  const height = Math.max(18, Math.min(60, Math.floor(free / Math.max(left.size, 1))));
  lanes = [{kind: 'axis', height: 22}, {kind: 'events', height: 16, name: 'events'}];
  if (recording.truth !== null) lanes.push({kind: 'truth', height: 16, name: 'label'});
  names.forEach((name, v) => lanes.push(
    {kind: 'slip', height: 16, variant: v, name: names.length > 1 ? `slip ${name}` : 'slip'}));
  groups.forEach((group, g) => {
    lanes.push({kind: 'group', height: 14, group: g, name: group.name});
    for (const member of group.members) {
      left.delete(member - 1);
      lanes.push({kind: 'channel', height, channel: member - 1, name: recording.channels[member - 1]});
    }
  });
  // Disabled here, not in the other variant.
  for (const channel of left) {
    lanes.push({kind: 'channel', height, channel, name: `${recording.channels[channel]} (off)`});
  }
  let top = 0;
  for (const lane of lanes) {
    lane.top = top;
    top += lane.height + (lane.kind === 'channel' ? 0 : 2);
  }
  canvas.style.height = `${top}px`;
}

function prepare(target) {
  const scale = window.devicePixelRatio || 1;
  const width = target.clientWidth, height = target.clientHeight;
  if (target.width !== Math.round(width * scale) || target.height !== Math.round(height * scale)) {
    target.width = Math.round(width * scale);
    target.height = Math.round(height * scale);
  }
  const context = target.getContext('2d');
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.fillStyle = '#fff';
  context.fillRect(0, 0, width, height);
  return [context, width, height];
}

function redraw() {
  if (pending) return;
  pending = true;
  canvas.ariaBusy = 'true';
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
  layOut();
  const [context, width, height] = prepare(canvas);
  const recording = now(), rate = recording.rate_hz;
  const scale = (width - GUTTER) / (view.to - view.from);
  const xOf = (seconds) => GUTTER + (seconds - view.from) * scale;
  const xOfRow = (row) => xOf(row / rate);
  context.save();
  context.beginPath();
  context.rect(GUTTER, 0, width - GUTTER, height);
  context.clip();
  if (data.truth) bars(context, data.truth, xOfRow, lanes[1].top, height, '#e8f2f9', width);
  if (view.chosen) markChosen(context, xOf, height);
  drawAxis(context, xOf, width, height);
  const scales = element('signal').value === 'volts' ? channelScales(data, scale) : null;
  for (const lane of lanes) {
    const box = [lane.top, lane.top + lane.height - 1];
    if (lane.kind === 'truth') bars(context, data.truth, xOfRow, ...box, '#7fb2d6', width);
    if (lane.kind === 'slip') bars(context, data.variants[lane.variant].slip, xOfRow, ...box, ON, width);
    if (lane.kind === 'group') {
      bars(context, data.variants[view.variant].groups[lane.group], xOfRow, ...box, '#e58a4e', width);
    }
    if (lane.kind === 'events') drawEvents(context, lane, xOf);
    if (lane.kind === 'channel') drawChannel(context, data, lane, xOfRow, scale, scales);
  }
  if (selection) {
    context.fillStyle = 'rgba(0, 114, 178, 0.2)';
    context.fillRect(xOf(selection[0]), 0, (selection[1] - selection[0]) * scale, height);
  }
  context.restore();
  drawNames(context, width);
  drawMinimap(data);
  Object.assign(canvas.dataset, {
    fromS: view.from, toS: view.to, recording: view.recording, variant: view.variant,
  });
  canvas.ariaBusy = String(pending);
  document.documentElement.dataset.readyMs ??= performance.now();
}

function bars(context, rows, xOfRow, top, bottom, color, width) {
  context.fillStyle = color;
  let left = null, right = null;
  for (let i = 0; i < rows.length; i += 2) {
    const a = xOfRow(rows[i]), b = Math.max(xOfRow(rows[i + 1]), a + 1);
    if (b < 0 || a > width) continue;
    if (left !== null && a <= right + 0.25) {
      right = Math.max(right, b);
      continue;
    }
    if (left !== null) context.fillRect(left, top, right - left, bottom - top);
    [left, right] = [a, b];
  }
  if (left !== null) context.fillRect(left, top, right - left, bottom - top);
}

function markChosen(context, xOf, height) {
  const [, start, end, latency] = view.chosen;
  context.fillStyle = '#fff3c4';
  context.fillRect(xOf(start), 0, Math.max(xOf(end) - xOf(start), 1), lanes[1].top + lanes[1].height);
  const line = (seconds, dash) => {
    context.setLineDash(dash);
    context.beginPath();
    context.moveTo(xOf(seconds), 0);
    context.lineTo(xOf(seconds), height);
    context.stroke();
  };
  context.strokeStyle = INK;
  context.lineWidth = 1;
  line(start, []);
  if (latency !== null) line(start + latency, [4, 3]);
  context.setLineDash([]);
}

const STEPS = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 36000];

function drawAxis(context, xOf, width, height) {
  const wanted = (view.to - view.from) / Math.max(2, (width - GUTTER) / 110);
  let step = STEPS.find((s) => s >= wanted) ?? 36000 * Math.ceil(wanted / 36000);
  if (wanted < 1) {
    const power = 10 ** Math.floor(Math.log10(wanted));
    step = [1, 2, 5, 10].map((s) => s * power).find((s) => s >= wanted * 0.999);
  }
  context.font = '12px system-ui, sans-serif';
  context.textAlign = 'left';
  context.textBaseline = 'middle';
  for (let k = Math.ceil(view.from / step); k * step <= view.to; k++) {
    const x = Math.round(xOf(k * step)) + 0.5;
    context.fillStyle = '#dfe3e6';
    context.fillRect(x - 0.5, 0, 1, height);
    context.fillStyle = INK;
    context.fillText(clock(k * step, step), x + 3, 10);
  }
}

function drawEvents(context, lane, xOf) {
  const y = lane.top + lane.height / 2;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  const events = eventsOf(view.recording);
  // Those that matter come last and lie on top.
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

// Which size of bins to draw: as many as there are pixels, not more.
function sizeFor(sizes, scale) {
  const bins = (1 / now().bin_rows) * (now().rate_hz / scale);
  const level = Math.max(0, Math.ceil(Math.log2(bins)));
  return Math.min(level, sizes.length - 1);
}

// What is drawn of a channel: where rows were kept, these, else bins. Calls
// piece(values by name, offset, first, stop, first row, rows of a value).
function pieces(data, channel, scale, piece) {
  const variant = data.variants[view.variant], recording = now();
  const size = sizeFor(data.low, scale), rows = recording.bin_rows * 2 ** size;
  // One more at either end, so that lines reach the edge.
  const from = view.from * recording.rate_hz - rows, to = view.to * recording.rate_hz + rows;
  const bins = (start, stop) => {
    const n = data.low[size].n;
    const first = Math.max(0, Math.floor(start / rows)), end = Math.min(n, Math.ceil(stop / rows));
    if (end > first) {
      piece({low: data.low[size].values, high: data.high[size].values,
        levels: variant.levels[size].values}, channel * n, first, end, 0, rows);
    }
  };
  let at = from;
  if (rows > 1 && size === 0) {
    for (const snippet of variant.snippets) {
      const stop = snippet.start + snippet.rows;
      if (stop <= from || snippet.start >= to) continue;
      if (snippet.start > at) bins(at, snippet.start);
      const first = Math.max(0, Math.floor(from) - snippet.start - 1);
      piece({low: snippet.volts, high: snippet.volts, levels: snippet.levels},
        channel * snippet.rows, first, Math.min(snippet.rows, Math.ceil(to) - snippet.start + 1),
        snippet.start, 1);
      at = stop;
    }
  }
  if (at < to) bins(at, to);
}

function channelScales(data, scale) {
  const recording = now();
  const scales = recording.channels.map((_, c) => {
    let low = NO_SAMPLE, high = -1;
    pieces(data, c, scale, (values, offset, first, stop) => {
      for (let i = offset + first; i < offset + stop; i++) {
        if (values.low[i] === NO_SAMPLE) continue;
        if (values.low[i] < low) low = values.low[i];
        if (values.high[i] > high) high = values.high[i];
      }
    });
    if (high < 0) return null;
    const step = recording.step_v[c], lowest = recording.lowest_v[c];
    return {middle: lowest + step * (low + high) / 2, span: step * (high - low)};
  });
  if (element('same-scale').checked) {
    const span = Math.max(0, ...scales.map((s) => s?.span ?? 0));
    scales.forEach((s) => s && (s.span = span));
  }
  return scales;
}

function drawChannel(context, data, lane, xOfRow, scale, scales) {
  const recording = now(), c = lane.channel;
  const top = lane.top + 1, bottom = lane.top + lane.height - STRIP - 2;
  const range = scales?.[c], step = recording.step_v[c], lowest = recording.lowest_v[c];
  lane.note = range ? volts(range.span) : '';
  const yOfCode = scales
    ? (code) => (top + bottom) / 2 - (range.span ? ((lowest + step * code - range.middle) / range.span) * (bottom - top) : 0)
    : (code) => bottom - Math.max(0, Math.min(1, (code - 48) / 160)) * (bottom - top);
  if (!scales) {
    context.fillStyle = '#c9a28c';
    context.fillRect(GUTTER, Math.round(yOfCode(THRESHOLD_CODE)), context.canvas.width, 1);
  }
  pieces(data, c, scale, (values, offset, first, stop, row, rows) => {
    const xOfIndex = (i) => xOfRow(row + i * rows);
    if (!scales || range) {
      // Wide bins are drawn as what they are; a line would pretend to know more.
      const wide = xOfIndex(1) - xOfIndex(0), blocks = rows > 1 && wide > 3;
      context.strokeStyle = '#3d5a73';
      context.fillStyle = '#9db3c5';
      context.lineWidth = 1;
      context.beginPath();
      let drawing = false;
      for (let i = first; i < stop; i++) {
        const k = offset + i;
        const low = scales ? values.low[k] : values.levels[k], high = scales ? values.high[k] : low;
        if (scales ? low === NO_SAMPLE : low === 0) {
          drawing = false;
          continue;
        }
        if (blocks) {
          const y = yOfCode(high);
          context.fillRect(xOfIndex(i), y - 0.5, wide, yOfCode(low) - y + 1);
          continue;
        }
        const x = xOfRow(row + (i + (rows > 1 ? 0.5 : 0)) * rows);
        if (drawing) context.lineTo(x, yOfCode(high));
        else context.moveTo(x, yOfCode(high) - 0.5);
        context.lineTo(x, yOfCode(low) + (drawing ? 0 : 0.5));
        drawing = true;
      }
      context.stroke();
    }
    // The strip: stretches of one colour in one go.
    let start = first, color = null;
    const y = lane.top + lane.height - STRIP - 1;
    const paint = (i) => {
      if (color === null || i === start) return;
      context.fillStyle = color;
      context.fillRect(xOfIndex(start), y, Math.max(xOfIndex(i) - xOfIndex(start), 1), STRIP);
    };
    for (let i = first; i < stop; i++) {
      const code = values.levels[offset + i];
      const next = code === 0 ? hatching(context)
        : code > THRESHOLD_CODE ? ON : SHADES[code & ~7];
      if (next !== color) {
        paint(i);
        [start, color] = [i, next];
      }
    }
    paint(stop);
  });
}

let hatch = null;
function hatching(context) {
  if (!hatch) {
    const tile = make('canvas');
    tile.width = tile.height = 4;
    const pen = tile.getContext('2d');
    pen.strokeStyle = '#999';
    pen.beginPath();
    pen.moveTo(0, 4);
    pen.lineTo(4, 0);
    pen.stroke();
    hatch = context.createPattern(tile, 'repeat');
  }
  return hatch;
}

function drawNames(context, width) {
  context.textBaseline = 'middle';
  for (const lane of lanes.slice(1)) {
    const channel = lane.kind === 'channel', y = lane.top + lane.height / 2;
    context.font = `${channel ? '' : '600 '}${channel && lane.height < 16 ? 10 : 12}px system-ui, sans-serif`;
    context.fillStyle = INK;
    context.textAlign = 'left';
    const two = channel && lane.note && lane.height >= 26;
    context.fillText(lane.name, channel ? 12 : 2, two ? y - 6 : y, GUTTER - 16);
    if (two) {
      context.font = '10px system-ui, sans-serif';
      context.fillStyle = MUTED;
      context.fillText(lane.note, 12, y + 6, GUTTER - 16);
    }
    if (lane.kind === 'group') {
      context.fillStyle = '#aeb6bc';
      context.fillRect(0, lane.top - 2, width, 1);
    }
  }
}

function drawMinimap(data) {
  const [context, width, height] = prepare(minimap), rate = now().rate_hz;
  const scale = (width - GUTTER) / duration();
  const xOf = (seconds) => GUTTER + seconds * scale, xOfRow = (row) => xOf(row / rate);
  context.fillStyle = '#f3f4f5';
  context.fillRect(GUTTER, 0, width - GUTTER, height);
  if (data.truth) bars(context, data.truth, xOfRow, 0, height, TRUTH, width);
  bars(context, data.variants[view.variant].slip, xOfRow, height * 0.55, height, ON, width);
  for (const event of eventsOf(view.recording)) {
    if (event[0] === 3) continue;
    context.fillStyle = KINDS[event[0]][2];
    context.fillRect(xOf(event[1]) - 1, 0, 2, height * 0.5);
  }
  context.fillStyle = 'rgba(60, 70, 80, 0.25)';
  context.fillRect(GUTTER, 0, xOf(view.from) - GUTTER, height);
  context.fillRect(xOf(view.to), 0, width - xOf(view.to), height);
  context.strokeStyle = INK;
  context.strokeRect(xOf(view.from) + 0.5, 0.5, Math.max((view.to - view.from) * scale - 1, 2), height - 1);
  context.fillStyle = INK;
  context.font = '600 12px system-ui, sans-serif';
  context.textBaseline = 'middle';
  context.fillText('whole', 2, height / 2);
}
