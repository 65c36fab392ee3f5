// Navigation in the timeline, the list of events, and the controls.

// ---- navigation

function look(from, to) {
  const least = 10 / now().rate_hz, whole = duration();
  const span = Math.min(Math.max(to - from, least), Math.max(whole, least));
  const start = Math.min(Math.max((from + to - span) / 2, 0), Math.max(whole - span, 0));
  [view.from, view.to] = [start, start + span];
  redraw();
}

const zoom = (factor, at = (view.from + view.to) / 2) =>
  look(at - (at - view.from) * factor, at + (view.to - at) * factor);
const pan = (seconds) => look(view.from + seconds, view.to + seconds);
const whole = () => look(0, duration());

const timeline = new Timeline(root, {
  tickText: clock,
  onLook: (from, to) => (Number.isFinite(from) ? look(from, to) : whole()),
  onPoint: readOut,
  onClick: chooseNear,
});

function chooseNear(at, lane, reach) {
  if (lane?.name !== 'events') return;
  const near = eventsOf(view.recording).map((event, i) => [event[0], Math.abs(event[1] - at), i])
    .filter(([, away]) => away < reach).sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  if (near.length) go(view.variant, view.recording, near[0][2]);
}

let strip = null;
const onStrip = (event) => {
  const box = minimap.getBoundingClientRect();
  return duration() * (event.clientX - box.left - NAMES_WIDTH) / (box.width - NAMES_WIDTH - RIGHT_MARGIN);
};
minimap.addEventListener('pointerdown', (event) => {
  minimap.setPointerCapture(event.pointerId);
  strip = {at: onStrip(event), x: event.clientX};
});
minimap.addEventListener('pointermove', (event) => {
  if (strip && Math.abs(event.clientX - strip.x) > 3) {
    const to = onStrip(event);
    look(Math.min(strip.at, to), Math.max(strip.at, to));
  }
});
minimap.addEventListener('pointerup', (event) => {
  if (strip && Math.abs(event.clientX - strip.x) <= 3) {
    pan(strip.at - (view.from + view.to) / 2);
  }
  strip = null;
});

function onKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches('select, input')) return;
  const keys = {n: () => step(1), p: () => step(-1)};
  if (event.target === root) {
    const tenth = (view.to - view.from) / 10;
    Object.assign(keys, {
      '+': () => zoom(0.5), '=': () => zoom(0.5), '-': () => zoom(2), Home: whole,
      ArrowLeft: () => pan(-tenth), ArrowRight: () => pan(tenth),
      PageUp: () => pan(-9 * tenth), PageDown: () => pan(9 * tenth),
    });
  }
  if (!keys[event.key]) return;
  event.preventDefault();
  keys[event.key]();
}
document.addEventListener('keydown', onKey);

function readOut(seconds, lane) {
  const {rate_hz: rate, lowest_v: lowest, step_v: step} = now(), words = [clock(seconds)];
  if (lane) words.push(lane.name);
  if (lane?.curve) {
    const {starts, found} = drawn;
    let k = starts.findLastIndex((row) => row <= seconds * rate);
    const piece = found.find(({first, stop}) => k < stop - first || (k -= stop - first) < 0);
    if (k >= 0 && piece) {
      const c = lane.channel, at = c * piece.n + piece.first + k;
      const [low, high] = [piece.low[at], piece.high[at]].map((code) => lowest[c] + step[c] * code);
      words.push(piece.low[at] === NO_SAMPLE ? 'no sample'
        : high > low ? `${volts(low)} to ${volts(high)}` : volts(low),
      `level / threshold ${ratio(piece.signals.level[at])}`);
      for (const name of ['excess', 'floor']) {
        const code = piece.signals[name]?.[at];
        if (code) words.push(`${name} ${decibels(name, code).toFixed(1)} dB`);
      }
    }
  }
  element('readout').textContent = words.join(' \u00b7 ');
}

// ---- events

function list() {
  const rows = [];
  header.recordings.forEach((_, r) => eventsOf(r).forEach((event, i) => {
    if (shown.has(event[0])) rows.push([r, i, event]);
  }));
  return rows;
}

function fillKinds() {
  const counts = KINDS.map(() => 0);
  header.recordings.forEach((_, r) => eventsOf(r).forEach((event) => counts[event[0]]++));
  element('kinds').replaceChildren(...KINDS.map(([name, mark], kind) => {
    const label = make('label'), box = make('input');
    box.type = 'checkbox';
    box.checked = shown.has(kind);
    box.addEventListener('change', () => {
      shown[box.checked ? 'add' : 'delete'](kind);
      listed = LISTED;
      fillList();
    });
    const text = make('span', ` ${mark} ${name} (${counts[kind]})`, `kind-${kind}`);
    label.append(box, text);
    return label;
  }));
}

function fillList() {
  const rows = list(), several = header.recordings.length > 1;
  const heads = ['', 'start', 'length', 'latency'], head = make('tr');
  head.append(...heads.map((text) => make('th', text)));
  document.querySelector('#event-list thead').replaceChildren(head);
  const body = document.querySelector('#event-list tbody');
  body.replaceChildren();
  const across = (text, className) => {
    const row = make('tr'), cell = make('td', text, className);
    cell.colSpan = heads.length;
    row.append(cell);
    body.append(row);
    return row;
  };
  const ms = (seconds) => (seconds === null ? '\u2013' : `${(1e3 * seconds).toFixed(0)}\u00a0ms`);
  let above = null;
  for (const [r, i, event] of rows.slice(0, listed)) {
    if (several && r !== above) across(header.recordings[r].name, 'name');
    above = r;
    const [kind, start, end, latency, parts, note] = event, row = make('tr');
    const link = make('a', `${KINDS[kind][1]} ${KINDS[kind][0]}`, `kind-${kind}`);
    link.href = `#event-${view.variant}-${r}-${i}`;
    const first = make('td');
    first.append(link);
    row.append(first);
    row.append(make('td', clock(start)), make('td', ms(end - start)), make('td', ms(latency)));
    body.append(row);
    row.dataset.event = `${r}-${i}`;
    const where = Object.entries(parts).map(([name, s]) => `${name} ${ms(s)}`);
    if (note) where.push(note);
    if (where.length) across(where.join(', '), 'where').dataset.event = row.dataset.event;
  }
  if (!rows.length) {
    const known = header.recordings.some((_, r) => eventsOf(r).length);
    across(known ? 'none of the kinds that are ticked' : 'no events');
  }
  element('more').hidden = rows.length <= listed;
  element('more').textContent = `show more (${rows.length - listed} left)`;
  markListed();
}

function markListed() {
  const key = view.chosen && `${view.recording}-${eventsOf(view.recording).indexOf(view.chosen)}`;
  for (const row of document.querySelectorAll('#event-list tbody tr')) {
    row.classList.toggle('chosen', row.dataset.event === key);
  }
  document.querySelector('#event-list tr.chosen')?.scrollIntoView({block: 'nearest'});
}

function go(v, r, i) {
  if (v !== view.variant) choose('variant', v);
  if (r !== view.recording) choose('recording', r);
  const event = eventsOf(r)[i];
  view.chosen = event;
  // Leave room before and after the event, and for a late alarm.
  const end = Math.max(Math.min(event[2], event[1] + 2), event[1] + (event[3] ?? 0));
  look(event[1] - 0.3, end + 0.4);
  markListed();
  const box = element('drawing').getBoundingClientRect();
  if (box.top < 0 || box.top > window.innerHeight - 150) element('toolbar').scrollIntoView();
}

function step(by) {
  const rows = list(), at = rows.findIndex(([r, , event]) => r === view.recording && event === view.chosen);
  const next = rows[at < 0 ? (by > 0 ? 0 : rows.length - 1) : at + by];
  if (!next) return;
  if (rows.indexOf(next) >= listed) {
    listed = rows.indexOf(next) + LISTED;
    fillList();
  }
  go(view.variant, next[0], next[1]);
}

function fromHash() {
  const match = /^#event-(\d+)-(\d+)-(\d+)$/.exec(location.hash);
  if (!match) return;
  const [v, r, i] = match.slice(1).map(Number);
  if (header.recordings[r]?.variants[v]?.events[i]) go(v, r, i);
}

element('event-list').addEventListener('click', (event) => {
  const key = event.target.closest('tr')?.dataset.event;
  if (!key) return;
  const [r, i] = key.split('-').map(Number);
  go(view.variant, r, i);
});
element('more').addEventListener('click', () => {
  listed += 1000;
  fillList();
});
window.addEventListener('hashchange', fromHash);

// ---- controls

function choose(what, value) {
  view[what] = value;
  view.chosen = null;
  if (what === 'recording') {
    element('recording').value = value;
    [view.from, view.to] = [0, duration()];
  } else {
    document.querySelector(`input[name=variant][value="${value}"]`).checked = true;
    listed = LISTED;
    fillKinds();
    fillList();
  }
  markListed();
  showScale();
  redraw();
}

function start() {
  header.recordings.forEach((recording, r) => {
    const option = make('option', recording.name);
    option.value = r;
    element('recording').append(option);
  });
  element('recording-choice').hidden = header.recordings.length < 2;
  element('recording').addEventListener('change', (event) => choose('recording', Number(event.target.value)));
  names.forEach((name, v) => {
    const label = make('label'), radio = make('input');
    Object.assign(radio, {type: 'radio', name: 'variant', value: v, checked: v === view.variant});
    radio.addEventListener('change', () => choose('variant', v));
    label.append(radio, ` ${name}`);
    element('variant-choice').append(label);
  });
  element('variant-choice').hidden = names.length < 2;
  const buttons = {
    'zoom-in': () => zoom(0.5), 'zoom-out': () => zoom(2), whole,
    previous: () => step(-1), next: () => step(1),
  };
  for (const [id, act] of Object.entries(buttons)) element(id).addEventListener('click', act);
  const signals = header.recordings.flatMap(({variants}) => variants.flatMap((v) => v.signals));
  for (const option of [...element('signal').options]) {
    if (option.value !== 'volts' && !signals.includes(option.value)) option.remove();
  }
  if (signals.includes('excess')) {
    element('signal').querySelector('[value=level]').textContent = 'level or evidence / threshold';
  }
  element('signal').addEventListener('change', (event) => {
    element('scale-choice').hidden = event.target.value !== 'volts';
    showScale();
    redraw();
  });
  element('same-scale').addEventListener('change', redraw);
  const all = header.recordings.flatMap((_, r) => eventsOf(r));
  if (all.length && all.every((event) => event[0] === 3)) shown.add(3);
  [view.from, view.to] = [0, Math.max(duration(), 10 / now().rate_hz)];
  fillKinds();
  fillList();
  showScale();
  fromHash();
  redraw();
  new ResizeObserver(redraw).observe(element('drawing'));
}

if (typeof DecompressionStream === 'undefined') {
  fail('This browser is too old for the timeline: it lacks DecompressionStream.');
} else start();
