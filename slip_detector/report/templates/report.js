// Navigation in the timeline, the list of events, and the controls.

function showSpan(from, to) {
  const least = 10 / now().rate_hz, whole = duration();
  const span = clamp(to - from, least, Math.max(whole, least));
  const start = clamp((from + to - span) / 2, 0, Math.max(whole - span, 0));
  [view.from, view.to] = [start, start + span];
  redraw();
}

const whole = () => showSpan(0, duration());

const timeline = new Timeline(root, {
  tickText: clock,
  onInterval: (from, to, how) => (how === 'whole' ? whole() : showSpan(from, to)),
  onPoint: (seconds, lane) => seconds !== null && readOut(seconds, lane),
});

listen(document, 'keydown', (event) => {
  if (isShortcut(event) || event.target.matches('select, input')) return;
  if (event.key === 'n') step(1);
  if (event.key === 'p') step(-1);
});

function readOut(seconds, lane) {
  const {rate_hz: rate, lowest_v: lowest, step_v: step} = now(), words = [clock(seconds)];
  if (lane) words.push(lane.name);
  const c = lane?.channel, i = Math.floor(seconds * rate / drawn.rows), at = c * drawn.n + i;
  if (lane?.curve && i >= drawn.first && i < drawn.stop) {
    const [low, high] = [drawn.low[at], drawn.high[at]].map((code) => lowest[c] + step[c] * code);
    words.push(drawn.low[at] === NO_SAMPLE ? 'no sample' : voltsBetween(low, high));
    words.push(wordsOf(drawn.codes[at]));
  }
  element('readout').textContent = words.join(' \u00b7 ');
}

const isTicked = ([, , [kind]]) => element('kinds').children[kind].firstChild.checked;
const ticked = () => everyEvent().filter(isTicked);

function fillList() {
  const unlabelled = header.recordings.some(({truth}) => !truth);
  const all = everyEvent(), body = document.querySelector('#event-list tbody');
  KINDS.forEach(([name, mark], kind) => {
    const count = all.filter(([, , event]) => event[0] === kind).length;
    const choice = element('kinds').children[kind];
    choice.lastChild.textContent = ` ${mark} ${name} (${count})`;
    choice.hidden = kind === ONSET ? !unlabelled : unlabelled && !count;
  });
  body.replaceChildren();
  const row = (event, ...cells) => body.append(build('tr', ...cells, {dataset: {event}}));
  const across = (key, text, kind = 'td') => row(key, build(kind, text, {colSpan: 4}));
  const ms = (seconds) => (seconds === null ? '\u2013' : `${(1e3 * seconds).toFixed(0)}\u00a0ms`);
  let above = header.recordings.length > 1 ? null : 0;
  for (const [r, i, [kind, start, end, latency, parts, note]] of ticked()) {
    if (r !== above) across('', header.recordings[r].name, 'td.name');
    above = r;
    const [name, mark] = KINDS[kind], key = `${r}-${i}`;
    const href = `#event-${view.variant}-${key}`;
    const link = build(`a.kind-${kind}`, `${mark} ${name}`, {href});
    const cells = [link, clock(start), ms(end - start), ms(latency)];
    row(key, ...cells.map((cell) => build('td', cell)));
    const stages = Object.entries(parts).map(([stage, s]) => `${stage} ${ms(s)}`);
    const where = [...stages, note].filter(Boolean).join(', ');
    if (where) across(key, where, 'td.where');
  }
  const none = all.length ? 'none of the kinds that are ticked' : 'no events';
  if (!body.children.length) across('', none);
  markChosen();
}

function markChosen() {
  const key = view.chosen && `${view.recording}-${eventsOf(view.recording).indexOf(view.chosen)}`;
  for (const row of document.querySelectorAll('#event-list tbody tr')) {
    row.classList.toggle('chosen', row.dataset.event === key);
  }
  const chosen = document.querySelector('#event-list tr.chosen');
  if (chosen) element('event-scroll').scrollTop = chosen.offsetTop - 50;
}

function go(v, r, i, scroll = true) {
  if (v !== view.variant) choose('variant', v);
  if (r !== view.recording) choose('recording', r);
  const [, start, end, latency] = view.chosen = eventsOf(r)[i];
  // Leave room before and after the event, and for a late alarm.
  showSpan(start - 0.3, Math.max(Math.min(end, start + 2), start + (latency ?? 0)) + 0.4);
  markChosen();
  const {top} = element('drawing').getBoundingClientRect();
  if (scroll && (top < 0 || top > innerHeight - 150)) element('toolbar').scrollIntoView();
}

function step(by) {
  const rows = ticked(), {recording, chosen} = view;
  const at = rows.findIndex(([r, , event]) => r === recording && event === chosen);
  const to = at < 0 ? (by > 0 ? 0 : rows.length - 1) : at + by;
  if (rows[to]) go(view.variant, ...rows[to]);
}

function fromHash() {
  const [v, r, i] = (/^#event-(\d+)-(\d+)-(\d+)$/.exec(location.hash) ?? []).slice(1).map(Number);
  if (header.recordings[r]?.variants[v]?.events[i]) go(v, r, i);
}

function choose(what, value) {
  Object.assign(view, {[what]: value, chosen: null});
  if (what === 'recording') {
    element('recording').value = value;
    [view.from, view.to] = [0, duration()];
  } else {
    document.querySelector(`input[name=variant][value="${value}"]`).checked = true;
    fillList();
  }
  markChosen();
  showScale();
  redraw();
}

// A box or a button of a group with its label.
const choice = (properties, label) => build('label', build('input', properties), label);

function start() {
  element('recording').append(...header.recordings.map(({name}, r) => new Option(name, r)));
  // What matters most is seen first: kinds are in this order.
  const [first] = everyEvent().sort((a, b) => a[2][0] - b[2][0]);
  element('variant-choice').append(...names.map((name, value) => {
    const checked = value === view.variant, onchange = () => choose('variant', value);
    return choice({type: 'radio', name: 'variant', value, checked, onchange}, ` ${name}`);
  }));
  element('kinds').append(...KINDS.map((_, kind) => {
    const checked = kind !== DETECTED || first?.[2][0] === DETECTED;
    return choice({type: 'checkbox', checked, onchange: fillList}, build(`span.kind-${kind}`));
  }));
  listen('recording', 'change', ({target}) => choose('recording', Number(target.value)));
  listen('whole', 'click', whole);
  listen('previous', 'click', () => step(-1));
  listen('next', 'click', () => step(1));
  listen('event-list', 'click', ({target}) => {
    const key = target.closest('tr')?.dataset.event;
    if (key) go(view.variant, ...key.split('-').map(Number));
  });
  listen('signal', 'change', redraw);
  listen(window, 'hashchange', fromHash);
  fillList();
  showScale();
  whole();
  if (first) go(view.variant, first[0], first[1], false);
  fromHash();
  new ResizeObserver(redraw).observe(element('drawing'));
  // A canvas does not follow the width of paper.
  listen(window, 'beforeprint afterprint', ({type}) => {
    root.style.width = type === 'beforeprint' ? '700px' : '';
    draw(drawn.data);
  });
}

start();
