// The live page: joins its parts. Texts from the robot go into textContent, never into HTML.

import {FingerCard, STATES} from './card.js';
import {Connection} from './connection.js';
import {News, Tool, pageKey, tabs, update, write} from './elements.js';
import {Parameters} from './parameters.js';
import {Played} from './played.js';
import {SpectrumPanel} from './spectrum.js';
import {Teach} from './teach.js';
import {Traces} from './traces.js';

// The drawings, in which parameters can be set. A refusal is shown at the top of the page.
class Drawings extends Tool {
  show() {
    const allowed = this.finger in this.labels && !this.locked;
    for (const each of [traces.line, spectrum]) each.allow(allowed);
  }
}

const connection = new Connection();
const news = new News(element('news'));
const parameters = new Parameters(connection), teach = new Teach(connection);
const drawings = new Drawings(connection, element('refusal'));
new Played(connection);
// The finger whose signals are shown, and the one that the user has chosen: the address keeps it.
let chosen = null, wanted = new URLSearchParams(location.hash.slice(1)).get('finger');
// Labels, by name, of fingers whose detectors have ended.
let gone = {};
const cards = new Map();
const changeView = (changes) => connection.changeView(changes);
const set = (values) => drawings.ask('set', {values});
const traces = new Traces(changeView, set), spectrum = new SpectrumPanel(changeView, set);
listen('keep-rest', 'click', () => drawings.ask('keep_rest'));

// The tab's title has the state of a finger that slips, else of one that is not at rest.
function showTitle() {
  const order = Object.keys(STATES), rank = ({root}) => order.indexOf(root.dataset.state);
  const known = [...cards.values()].filter(({state}) => state);
  const [first] = known.sort((a, b) => rank(a) - rank(b));
  const lead = first ? `${first.badge.textContent} ${first.finger.label} \u00b7 ` : '';
  update(document, {title: `${lead}slip_view`});
}

function choose(name) {
  wanted = name;
  history.replaceState(null, '', `#${new URLSearchParams({finger: name})}`);
  if (name !== chosen) show(name);
}

function show(name) {
  for (const line of [traces.line, ...spectrum.lines.values()]) line.settle();
  chosen = name;
  connection.changeView({finger: name ?? '', until_ns: null});
  for (const tool of [parameters, teach, drawings]) tool.choose(name);
  showChosen();
}

function showChosen() {
  for (const [name, card] of cards) card.mark(name === chosen);
  const finger = cards.get(chosen)?.finger;
  const label = finger?.label ?? `${gone[chosen]}, which is gone`;
  write('signals-title', `Signals of ${label}`);
  write('tools-title', `Set up ${label}`);
  if (finger) for (const part of [traces, spectrum]) part.show(finger);
  drawings.show();
}

connection.on('state', (words) => {
  write('connection', words || 'connected');
  element('connection').classList.toggle('lost', Boolean(words));
  // Without a connection, what cards show is old.
  if (words) for (const card of cards.values()) if (card.state) card.showState('lost');
  showTitle();
});

connection.on('fingers', ({fingers, gone: labels, read_only: readOnly}) => {
  gone = labels;
  const names = fingers.map(({name}) => name);
  for (const [name, card] of cards) {
    if (names.includes(name)) continue;
    news.note(card.finger.label, 'detector gone');
    card.root.remove();
    cards.delete(name);
  }
  fingers.forEach((finger, i) => {
    const card = cards.get(finger.name) ?? new FingerCard();
    cards.set(finger.name, card);
    card.describe(finger, readOnly);
    const place = element('fingers').children[i] ?? null;
    if (place !== card.root) element('fingers').insertBefore(card.root, place);
  });
  write('ended', Object.values(gone).join(', '));
  document.querySelector('main').classList.toggle('single', fingers.length === 1);
  connection.changeView({fingers: names});
  // A finger that is gone may come back: until then, no change must go to another finger.
  const stays = [wanted, chosen].find((name) => names.includes(name));
  const next = stays ?? (chosen in gone ? chosen : names[0] ?? null);
  if (next !== chosen) show(next);
  else showChosen();
});

connection.on('diagnostics', ({fingers}) => {
  for (const [name, lines] of Object.entries(fingers)) cards.get(name)?.showDiagnostics(lines);
});

connection.on('frame', ({header, arrays}) => {
  header.fingers.forEach((state, i) => {
    const card = cards.get(state.name);
    if (!card || arrays[`level/${i}`].length !== card.finger.channels.length) return;
    card.show(state, ...['level', 'on', 'groups'].map((part) => arrays[`${part}/${i}`]));
    news.note(card.finger.label, card.words);
  });
  showTitle();
  if (header.traces) traces.take(header.traces, arrays);
  if (header.spectrum) spectrum.take(header.spectrum, arrays);
});

connection.on('age', (words) => write('age', words));
connection.on('bag_places', ({places}) => (traces.places = places));

const [signalTabs, toolTabs] = document.querySelectorAll('[role=tablist]');
tabs(signalTabs, (id) => spectrum.open(id === 'spectrum-tab'));
tabs(toolTabs);

listen('fingers', 'click', ({target}) => {
  const finger = target.closest('.finger')?.dataset.finger;
  const channel = Number(target.dataset.channel);
  if (target.matches('.take')) drawings.ask('take_input', {finger});
  else if (channel || target.matches('.title')) choose(finger);
  if (channel) traces.chooser.toggle(channel);
});

listen('to-threshold', 'click', () => {
  element('traces-tab').click();
  traces.line.root.focus();
});

listen(document, 'keydown', (event) => {
  const key = pageKey(event), finger = element('fingers').children[key - 1]?.dataset.finger;
  if (finger) choose(finger);
  else if (key === 'p') traces.pauseOrGoOn();
  else if (key === '?') element('keys').toggleAttribute('open');
  else return;
  event.preventDefault();
});

connection.open();
