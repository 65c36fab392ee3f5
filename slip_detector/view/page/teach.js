// Teaching: record rest, slips and taps, tune the detector on them, apply and save. The recordings are
// on the server; this page only shows them, and may be closed at any time.

import {Tool, build, button, tableRow} from './elements.js';

// Period, in milliseconds, at which the page reports that a slip is held; the server ends the slip
// when the reports stop.
const PRESSED_MS = 200;

// What to record: kind, word on the button, key, amount that is wanted, and what to do meanwhile.
const KINDS = [
  ['rest', 'Rest', 'R', {recordings: 2, seconds: 60}, 'Hold the object as firmly as the hand will, with all motors on. Nothing slides. Half a minute, twice.'],
  ['slip', 'Slip', 'Space', {recordings: 20}, 'Press, then pull the object through the fingers; let go of the key when it stands still. Two seconds of rest between two slips; slow and fast ones, in all directions.'],
  ['taps', 'Taps', 'T', {recordings: 2, seconds: 60}, 'Knock on object, finger and table, every two seconds. Nothing slides. Half a minute, twice.'],
];

const KEY_WORDS = {
  rest: 'record rest; again: end it', taps: 'record taps; again: end it',
  slip: 'record a slip, as long as it is held; on its button Enter begins and ends one',
};

export class Teach extends Tool {
  // root: an empty element, hidden while another tab is chosen. keys: a list of keys that is shown.
  constructor(connection, root, keys) {
    super(connection);
    this.root = root;
    this.latest = {fingers: {}, words: '', tuning: null};
    // The present recording, null if there is none; undefined until the server reports it.
    this.recording = undefined;
    this.pressed = null;
    this.build(keys);
    connection.on('teaching', (message) => {
      this.latest = message;
      this.show();
    });
    connection.on('recording', ({recording}) => {
      // The server may have ended the slip itself, when the disk is full, for example.
      if (this.recording?.slipping && !recording?.slipping) this.drop();
      this.recording = recording;
      this.showRecording();
    });
  }

  // Teach this finger.
  choose(finger) {
    if (finger === this.finger) return;
    this.release();
    this.finger = finger;
    this.refuse('');
    this.refresh();
    this.show();
  }

  // Let the server update the list of recordings.
  refresh() {
    if (this.finger) this.connection.request('recordings', {finger: this.finger});
  }

  build(keys) {
    this.buttons = {};
    const row = build('div.teach-buttons');
    for (const [kind, word, key, , advice] of KINDS) {
      const said = build('span.unseen', advice, {id: `advice-${kind}`});
      // Not enabled until the server has described the fingers.
      this.buttons[kind] = build('button.teach-button', build('span.word', word), build('kbd', kind === 'slip' ? 'hold Space' : key),
        build('span.progress-words'), {type: 'button', disabled: true, ariaPressed: 'false', ariaKeyShortcuts: key, title: advice});
      this.buttons[kind].setAttribute('aria-describedby', said.id);
      row.append(this.buttons[kind], said);
      keys.append(build('div', build('dt', kind === 'slip' ? 'Space, held' : key), build('dd', KEY_WORDS[kind])));
    }
    const advice = build('ol.hint', ...KINDS.map(([, word, , , words]) => build('li', build('b', `${word}. `), words)));
    this.now = build('p.teach-now');
    this.words = build('p.teach-words', {role: 'status'});
    this.where = build('p.hint');
    this.rows = build('tbody');
    const head = tableRow(['Name', 'Length', 'Slips', 'For', ''], 5, 'col');
    head.lastChild.ariaLabel = 'Delete';
    const list = build('table.recordings', build('caption', 'Recordings'), build('thead', head), this.rows);
    this.scroller = build('div.recordings-frame', list, {tabIndex: 0, role: 'region', ariaLabel: 'Recordings'});
    const tuning = build('section.tuning');
    this.tuning = new Tuning(tuning, (type) => this.ask(type));
    this.root.append(advice, row, this.now, this.words, this.line, this.scroller, this.where, tuning);
    this.listen();
  }

  listen() {
    for (const kind of ['rest', 'taps']) this.buttons[kind].addEventListener('click', () => this.toggle(kind));
    const slip = this.buttons.slip;
    slip.addEventListener('pointerdown', (event) => {
      if (event.button) return;
      slip.setPointerCapture(event.pointerId);
      this.press();
    });
    for (const end of ['pointerup', 'pointercancel']) slip.addEventListener(end, () => this.release());
    slip.addEventListener('contextmenu', (event) => event.preventDefault());
    // A click without a pointer comes from Enter or a screen reader, which cannot hold a button: one click
    // begins the slip, the next one ends it.
    slip.addEventListener('click', ({detail}) => {
      if (detail) return;
      if (this.pressed === null) this.press();
      else this.release();
    });
    // A clicked button loses the focus, so that the space bar records slips and does not click again.
    document.addEventListener('click', ({detail, target}) => {
      if (detail && !this.root.hidden) target.closest('button, summary')?.blur();
    });
    document.addEventListener('keydown', (event) => this.onKey(event));
    document.addEventListener('keyup', (event) => {
      if (event.key !== ' ') return;
      // Some browsers would click otherwise.
      if (event.target === slip) event.preventDefault();
      this.release();
    });
    // A hidden page does not notice that the key is released.
    window.addEventListener('blur', () => this.release());
    document.addEventListener('visibilitychange', () => this.release());
  }

  onKey(event) {
    if (this.root.hidden || event.ctrlKey || event.altKey || event.metaKey) return;
    const {target} = event;
    // A key that is kept down is one press.
    if (event.repeat && target.matches('.teach-button')) event.preventDefault();
    if (target.matches('input, select, textarea, [contenteditable]')) return;
    if (!element('keys-act').checked && target !== this.buttons.slip) return;
    if (event.key === ' ') {
      // On other controls the space bar keeps its usual meaning.
      if (target.matches('button, summary, a, [role=slider], [role=tab]') && target !== this.buttons.slip) return;
      event.preventDefault();
      if (!event.repeat) this.press();
      return;
    }
    const kind = {r: 'rest', t: 'taps'}[event.key.toLowerCase()];
    if (kind && !event.repeat) this.toggle(kind);
  }

  toggle(kind) {
    if (this.buttons[kind].disabled) return;
    this.teach(this.recording?.kind === kind ? 'stop' : kind);
  }

  press() {
    if (this.pressed !== null || this.buttons.slip.disabled) return;
    this.pressed = setInterval(() => this.connection.request('teach', {do: 'still_pressed'}), PRESSED_MS);
    this.teach('press').then((refusal) => {
      if (refusal) this.drop();
    });
  }

  release() {
    if (this.pressed === null) return;
    this.drop();
    this.teach('release');
  }

  drop() {
    clearInterval(this.pressed);
    this.pressed = null;
  }

  teach(what) {
    return this.ask('teach', {do: what});
  }

  show() {
    const {recordings = [], folder} = this.latest.fingers[this.finger] ?? {};
    // After a restart, the server has not listed the recordings yet.
    if (this.finger in this.labels && !(this.finger in this.latest.fingers)) this.refresh();
    this.words.textContent = this.latest.words;
    this.where.textContent = folder ? `In ${folder}. Each third recording of a kind is held out: the search does not see it, and is judged by it.` : '';
    const shown = JSON.stringify([recordings, this.locked]);
    if (shown !== this.shown) this.showList(recordings);
    this.shown = shown;
    for (const [kind, , , wanted] of KINDS) {
      const some = recordings.filter((one) => one.kind === kind && one.usable);
      const seconds = some.reduce((sum, {duration_s: s}) => sum + s, 0);
      const done = some.length >= wanted.recordings && seconds >= (wanted.seconds ?? 0);
      const words = kind === 'slip' ? `${some.length} of ${wanted.recordings}` : `${some.length} of ${wanted.recordings}, ${Math.round(seconds)} s`;
      this.buttons[kind].querySelector('.progress-words').textContent = `${words}${done ? ' ✓' : ''}`;
    }
    this.tuning.show(this.latest.tuning, {
      finger: this.finger, slips: recordings.filter(({slips}) => slips).length,
      locked: this.locked || !(this.finger in this.labels),
    });
    this.showRecording();
  }

  showList(recordings) {
    this.scroller.hidden = !recordings.length;
    this.rows.replaceChildren(...recordings.map(({name, duration_s: seconds, slips, usable, held_out: heldOut, note}) => {
      const remove = button('Delete', () => {
        if (confirm(`Delete ${name}, ${seconds.toFixed(1)} s? It cannot be brought back.`)) this.ask('delete_recording', {recording: name});
      }, {ariaLabel: `Delete ${name}`, disabled: this.locked});
      const row = tableRow([name, `${seconds.toFixed(1)} s`, String(slips), heldOut ? 'held out' : usable ? 'tuning' : 'not used', remove], 1, 'row');
      if (note) row.firstChild.append(build('p.notice', note));
      return row;
    }));
  }

  showRecording() {
    const {recording} = this, mine = recording?.finger === this.finger;
    if (recording === undefined) return;
    const usable = this.finger in this.labels && !this.locked;
    for (const [kind] of KINDS) {
      const button = this.buttons[kind], runs = mine && recording.kind === kind && !recording.ending;
      button.ariaPressed = String(Boolean(runs));
      button.disabled = !usable || (recording !== null && !recording.ending && !(mine && recording.kind === kind));
    }
    this.now.classList.toggle('runs', recording !== null);
    if (recording === null) {
      this.now.textContent = this.locked ? 'Pages may only look: slip_view was started with --read-only.' : 'Nothing is recorded now.';
      return;
    }
    const where = mine ? '' : ` of ${this.labels[recording.finger] ?? recording.finger}`;
    const what = recording.slipping ? ', SLIP' : recording.ending ? ', the rest after it: hold still' : '';
    this.now.textContent = `● ${recording.name}${where}: ${recording.seconds.toFixed(1)} s${what}${recording.silent && `. ${recording.silent}`}`;
  }
}

// Tuning on the recordings: progress, the comparison on held-out recordings, apply.
const LEAST_SLIPS = 2;

class Tuning {
  // root: an empty element. ask(type, content): sends a request; resolves with the refusal, or ''.
  constructor(root, ask) {
    this.ask = ask;
    this.begin = button('Tune', () => this.ask('tune'));
    this.stop = button('Stop, keep what was found', () => this.ask('stop_tuning'));
    this.progress = build('progress', {ariaLabel: 'Progress of the search'});
    this.step = build('p.tuning-step', {role: 'status'});
    this.failed = build('p.refusal', {role: 'alert'});
    this.lines = build('ul.hint');
    this.table = build('table.compared');
    this.apply = button('Apply', () => this.ask('apply_tuning'));
    this.result = build('div', this.table, this.apply);
    root.append(build('h3', 'Tune'), build('div.buttons', this.begin, this.stop), this.progress, this.step, this.failed,
      this.lines, this.result);
  }

  // tuning: the state that the server reports, or null. slips: the number of recordings with slips.
  show(tuning, {finger, slips, locked}) {
    const mine = tuning?.finger === finger ? tuning : null, runs = Boolean(tuning?.running);
    this.begin.disabled = locked || runs || slips < LEAST_SLIPS;
    this.begin.title = slips < LEAST_SLIPS ? 'Record slips first' : '';
    this.stop.disabled = locked || !runs || tuning.stopping;
    this.progress.hidden = !mine?.running;
    if (mine?.running && mine.share) this.progress.value = mine.share;
    else this.progress.removeAttribute('value');
    this.step.textContent = this.stepWords(tuning, mine, slips);
    this.failed.textContent = mine?.failed ? `Tuning failed: ${mine.failed}. What was recorded is kept.` : '';
    this.failed.hidden = !mine?.failed;
    this.lines.replaceChildren(...(mine?.lines ?? []).map((line) => build('li', line)));
    this.showTable(mine?.table ?? []);
    this.apply.disabled = locked || runs || !mine?.changes;
    this.apply.textContent = mine?.changes ? `Apply ${mine.changes} values` : 'Apply';
  }

  stepWords(tuning, mine, slips) {
    if (mine?.stopping) return 'stopping; the best result so far is evaluated and kept';
    if (mine?.running) return mine.step;
    if (tuning?.running) return 'another finger is being tuned';
    if (mine?.table.length) {
      return mine.changes ? 'Done. Apply sets the running detector; Save, below, writes what it runs with.' : 'Nothing better was found: the detector is as good as it was.';
    }
    return slips < LEAST_SLIPS ? 'Tuning needs two slips at least; twenty are good.' : '';
  }

  showTable(rows) {
    this.result.hidden = !rows.length;
    const shown = JSON.stringify(rows);
    if (shown === this.shown) return;
    this.shown = shown;
    const head = build('tr', build('td'), ...['as it runs', 'tuned'].map((title) => build('th', title, {scope: 'col'})), build('td'));
    const body = rows.map(([title, before, after, change]) => {
      const row = tableRow([title, before, after, change && `${change === 'better' ? '▲' : '▽'} ${change}`], 1, 'row');
      row.className = change;
      return row;
    });
    this.table.replaceChildren(build('caption', 'On what was held out'), build('thead', head), build('tbody', ...body));
  }
}
