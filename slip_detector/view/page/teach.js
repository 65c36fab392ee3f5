// Teaching: record rest, slips, taps and presses, tune the detector on them, apply and save. The recordings are
// on the server; this page only shows them, and may be closed at any time.

import {Tool, button, holdable, tableRow, write} from './elements.js';
import {RecordingTrace} from './recording_trace.js';

// Period, in milliseconds, at which the page reports that a slip is held; the server ends the slip
// when the reports stop.
const PRESSED_MS = 200;

// How much to record of each kind.
const LONG = [[60, 's'], [2, 'times']], WANTED = {rest: LONG, slip: [[20, 'slips']], taps: LONG, press: LONG};
const KIND_OF = {r: 'rest', t: 'taps', s: 'press'};
const LEAST_SLIPS = 2;

export class Teach extends Tool {
  constructor(connection) {
    super(connection, element('teach-refusal'));
    this.root = element('teach');
    this.latest = {fingers: {}, words: '', tuning: null};
    // The present recording, null if there is none; undefined until the server reports it.
    this.recording = undefined;
    // Reports that the key is held, while it is; null otherwise.
    this.pressed = null;
    this.buttons = Object.fromEntries(Object.keys(WANTED).map((kind) => [kind, element(`record-${kind}`)]));
    // By name the pictures of the recordings of the finger.
    this.traces = new Map();
    connection.on('parameters', ({fingers}) => this.loadTraces(fingers[this.finger]?.changes[0]?.[0] ?? ''));
    connection.on('teaching', (latest) => Object.assign(this, {latest}).show());
    connection.on('recording', ({recording}) => {
      // The server may have ended the slip itself, when the disk is full, for example.
      if (this.recording?.slipping && !recording?.slipping) this.drop();
      this.recording = recording;
      this.showRecording();
    });
    for (const kind of Object.values(KIND_OF)) this.buttons[kind].addEventListener('click', () => this.toggle(kind));
    for (const [id, type] of [['tune', 'tune'], ['stop-tuning', 'stop_tuning'], ['apply', 'apply_tuning']]) {
      element(id).addEventListener('click', () => {
        const why = id === 'apply' && this.latest.tuning?.kept && this.latest.tuning.answer[0];
        this.awaits ||= id === 'tune';
        if (!why || confirm(`${why} Apply it nevertheless?`)) this.ask(type, {}, element(id));
      });
    }
    const slip = this.buttons.slip;
    holdable(slip, {press: () => this.press(), release: () => this.release(), isHeld: () => this.pressed !== null});
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
  }

  choose(finger) {
    this.release();
    this.traces.clear();
    super.choose(finger);
    this.connection.request('recordings', {finger});
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
    const kind = KIND_OF[event.key.toLowerCase()];
    if (kind && !event.repeat) this.toggle(kind);
  }

  toggle(kind) {
    if (!this.buttons[kind].disabled) this.teach(this.recording?.kind === kind ? 'stop' : kind);
  }

  press() {
    if (this.pressed !== null || this.buttons.slip.disabled) return;
    this.pressed = setInterval(() => this.connection.request('teach', {do: 'still_pressed'}), PRESSED_MS);
    this.teach('slip').then(({refusal}) => refusal && this.drop());
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
    return this.ask('teach', {do: what}, element('teach-now'));
  }

  show() {
    const {finger, latest, labels} = this, its = latest.fingers[finger] ?? {recordings: []};
    // After a restart, the server has not listed the recordings yet.
    if (finger in labels && !its.folder) this.connection.request('recordings', {finger});
    const {recordings, held_out: heldOut, folder, obeys, interrupted} = its;
    write('teach-words', latest.words);
    element('obeys').hidden = !obeys;
    write('recordings-folder', folder ? `In ${folder}.` : '');
    const shown = JSON.stringify([recordings, heldOut, this.locked]);
    if (shown !== this.shown) this.showList(recordings, heldOut);
    this.shown = shown;
    for (const [kind, wanted] of Object.entries(WANTED)) {
      const some = recordings.filter((one) => one.kind === kind && one.usable);
      // Rounded down: what is nearly enough is not enough.
      const tenths = Math.floor(10 * some.reduce((sum, one) => sum + one.duration_s, 0));
      const has = {s: (tenths / 10).toFixed(1), times: some.length, slips: some.length};
      const missing = wanted.filter(([n, unit]) => has[unit] < n);
      const words = missing.map(([n, unit]) => `${has[unit]} of ${n}\u00a0${unit}`);
      const place = this.buttons[kind].querySelector('.progress-words');
      write(place, words.join('\n') || `\u2713 ${wanted[0].join('\u00a0')}`);
      element(`advice-${kind}`).hidden = !missing.length;
    }
    this.showTuning(recordings.filter(({slips}) => slips).length, interrupted);
    this.showRecording();
  }

  showList(recordings, heldOut) {
    const ask = (type, content) => this.ask(type, content, element('recordings-frame'));
    // What is marked as a mistake has no labels to be seen.
    const seen = recordings.filter(({mistaken}) => !mistaken).map(({name}) => name);
    this.traces = new Map(seen.map((name) => [name, this.traces.get(name) ?? this.traceOf(name)]));
    element('recordings').replaceChildren(...recordings.flatMap((one) => {
      const {name, duration_s: seconds, usable, mistaken, note} = one, disabled = this.locked;
      const act = (word, asks) => button(word, asks, {ariaLabel: `${word} ${name}`, disabled});
      const length = `${seconds.toFixed(1)} s`;
      const sure = () => confirm(`Delete ${name}, ${length}? It cannot be brought back.`);
      const remove = act('Delete', () => sure() && ask('delete_recording', {recording: name}));
      const marks = () => ask('mark_recording', {recording: name, mistaken: !mistaken});
      const mark = act(mistaken ? 'Count again' : 'Mistake', marks);
      const use = heldOut.includes(name) ? 'held out' : usable ? 'tuning' : 'not used';
      const buttons = build('span.buttons', mark, remove);
      const row = tableRow([name, length, mistaken ? 'mistake' : use, buttons]);
      if (note) row.firstChild.append(build('p.notice', note));
      const trace = this.traces.get(name);
      trace?.allow(!disabled);
      return trace ? [row, build('tr', build('td', trace.root, {colSpan: 4}))] : [row];
    }));
    this.loadTraces(this.decided);
  }

  traceOf(recording) {
    const {finger, connection} = this;
    // What nobody has asked for is not refused in words that take the place of others.
    return new RecordingTrace(recording, (type, content) => (type === 'trace'
      ? connection.request(type, {finger, recording})
      : this.ask(type, {finger, recording, ...content}, element('recordings-frame'))));
  }

  // Load the pictures that are missing, or all if the detector decides otherwise now.
  loadTraces(decided) {
    for (const trace of this.traces.values()) if (!trace.loaded || decided !== this.decided) trace.load();
    this.decided = decided;
  }

  showRecording() {
    const {recording} = this, mine = recording?.finger === this.finger;
    if (recording === undefined) return;
    const usable = this.finger in this.labels && !this.locked;
    for (const [kind, button] of Object.entries(this.buttons)) {
      const its = mine && recording.kind === kind;
      button.ariaPressed = String(Boolean(its && !recording.ending));
      button.disabled = !usable || (recording !== null && !recording.ending && !its);
    }
    const {words: lost} = this.connection;
    element('teach-now').classList.toggle('runs', recording !== null && !lost);
    write('teach-now', lost ? 'Not connected: what is recorded is not known.' : recording ? `\u25cf ${recording.words}`
      : this.readOnly ? 'Pages may only look: slip_view was started with --read-only.' : 'Nothing is recorded now.');
  }

  // slips: the number of recordings with slips; interrupted: whether an earlier search can go on.
  showTuning(slips, interrupted) {
    const {tuning} = this.latest, locked = this.locked || !(this.finger in this.labels);
    const mine = tuning?.finger === this.finger ? tuning : null, runs = Boolean(tuning?.running);
    const {answer = [], table = [], lines = []} = mine ?? {};
    element('tune').disabled = locked || runs || slips < LEAST_SLIPS;
    write('tune', interrupted ? 'Go on' : 'Tune');
    element('stop-tuning').disabled = locked || !runs || tuning.stopping;
    Object.assign(element('tuning-progress'), {hidden: !mine?.running, value: mine?.share ?? 0});
    write('tuning-step', this.stepWords(tuning, mine, slips, interrupted));
    write('tuning-failed', mine?.failed ? `Tuning failed: ${mine.failed}. What was recorded is kept.` : '');
    write('tuning-answer', answer[0] ?? '');
    write('tuning-worse', answer.slice(1).join(' '));
    element('apply').disabled = locked || runs || !mine?.changes;
    write('apply', mine?.changes ? `Apply ${mine.changes} values${mine.kept ? ' nevertheless' : ''}` : 'Apply');
    element('compared').replaceChildren(...table.map((cells) => (
      Object.assign(tableRow(cells), {className: cells.at(-1)}))));
    element('tuning-lines').replaceChildren(...lines.map((line) => build('li', line)));
    // Who has pressed Tune sees the result wherever the page is scrolled to.
    if (this.awaits && answer.length) element('tuning-result').scrollIntoView({block: 'nearest'});
    this.awaits &&= !answer.length;
  }

  stepWords(tuning, mine, slips, interrupted) {
    if (mine?.stopping) return 'stopping; the best result so far is evaluated and kept';
    if (mine?.running) return mine.step;
    if (tuning?.running) return 'another finger is being tuned';
    if (mine?.answer.length) return mine.kept ? '' : 'Done. Save, below, writes what runs after Apply.';
    if (interrupted) return 'A search was interrupted: Go on uses what it has found so far.';
    return slips < LEAST_SLIPS ? 'Tuning needs two slips at least; twenty are good.' : '';
  }
}
