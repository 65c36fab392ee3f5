// Teaching: record rest, slips, taps and presses, tune the detector on them, apply and save. The
// recordings are on the server: this page may be closed at any time.

import {Tool, button, holdable, pageKey, tableRow, write} from './elements.js';
import {RecordingTrace} from './recording_trace.js';

// Period of the reports that a slip is held: the server ends it when they stop.
const PRESSED_MS = 200;

const LONG = [[60, 's'], [2, 'times']], TWENTY = [[20, 'slips']];
const WANTED = {rest: LONG, slip: TWENTY, taps: LONG, press: LONG};
const KIND_OF = {r: 'rest', t: 'taps', s: 'press'};
const LEAST_SLIPS = 2;

export class Teach extends Tool {
  constructor(connection) {
    super(connection, element('teach-refusal'));
    this.root = element('teach');
    this.latest = {fingers: {}, words: '', tuning: null};
    // The present recording, null if there is none; undefined until the server reports it.
    this.recording = undefined;
    // Reports that the key is held, while it is.
    this.pressed = null;
    this.buttons = {};
    for (const kind of Object.keys(WANTED)) this.buttons[kind] = element(`record-${kind}`);
    this.traces = new Map();
    connection.on('parameters', ({fingers}) => (
      this.loadTraces(fingers[this.finger]?.changes[0]?.[0] ?? '')));
    connection.on('teaching', (latest) => Object.assign(this, {latest}).show());
    connection.on('recording', ({recording}) => {
      // The server may have ended the slip itself, when the disk is full, for example.
      if (this.recording?.slipping && !recording?.slipping) this.drop();
      this.recording = recording;
      this.showRecording();
    });
    for (const kind of Object.values(KIND_OF)) {
      listen(this.buttons[kind], 'click', () => this.toggle(kind));
    }
    listen('tune', 'click', ({target}) => {
      this.awaits = true;
      this.ask('tune', {}, target);
    });
    listen('stop-tuning', 'click', ({target}) => this.ask('stop_tuning', {}, target));
    listen('apply', 'click', ({target}) => {
      const {kept, answer: [why] = []} = this.latest.tuning ?? {};
      if (!kept || confirm(`${why} Apply it nevertheless?`)) this.ask('apply_tuning', {}, target);
    });
    const {slip} = this.buttons, isHeld = () => this.pressed !== null;
    holdable(slip, {press: () => this.press(), release: () => this.release(), isHeld});
    // A clicked button loses the focus: the space bar records slips and does not click again.
    listen(document, 'click', ({detail, target}) => {
      if (detail && !this.root.hidden) target.closest('button, summary')?.blur();
    });
    listen(document, 'keydown', (event) => this.onKey(event));
    listen(document, 'keyup', (event) => {
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
    if (this.root.hidden || isShortcut(event)) return;
    const {target, repeat} = event, isOnSlip = target === this.buttons.slip;
    // A key that is kept down is one press.
    if (repeat && target.matches('.teach-button')) event.preventDefault();
    const key = isOnSlip ? event.key.toLowerCase() : pageKey(event);
    // On other controls the space bar keeps its usual meaning.
    const means = !isOnSlip && target.matches('button, summary, input, [role=slider]');
    if (key === ' ' && !means) {
      event.preventDefault();
      if (!repeat) this.press();
    } else if (key in KIND_OF && !repeat) this.toggle(KIND_OF[key]);
  }

  toggle(kind) {
    if (this.buttons[kind].disabled) return;
    this.teach(this.recording?.kind === kind ? 'stop_recording' : 'record', {kind});
  }

  press() {
    if (this.pressed !== null || this.buttons.slip.disabled) return;
    const report = () => this.connection.request('hold_slip');
    this.pressed = setInterval(report, PRESSED_MS);
    this.teach('begin_slip').then(({refusal}) => refusal && this.drop());
  }

  release() {
    if (this.pressed === null) return;
    this.drop();
    this.teach('end_slip');
  }

  drop() {
    clearInterval(this.pressed);
    this.pressed = null;
  }

  teach(type, content) {
    return this.ask(type, content, element('teach-now'));
  }

  show() {
    const {finger, latest, labels} = this, known = latest.fingers[finger] ?? {recordings: []};
    // After a restart, the server has not listed the recordings yet.
    if (finger in labels && !known.folder) this.connection.request('recordings', {finger});
    const {recordings, folder, obeys, interrupted} = known;
    write('teach-words', latest.words);
    element('obeys').hidden = !obeys;
    write('recordings-folder', folder ? `In ${folder}.` : '');
    const listed = JSON.stringify([recordings, this.locked]);
    if (listed !== this.listed) this.showList(recordings);
    this.listed = listed;
    for (const [kind, wanted] of Object.entries(WANTED)) {
      const made = recordings.filter((each) => each.kind === kind && each.usable);
      // Rounded down: what is nearly enough is not enough.
      const tenths = Math.floor(10 * made.reduce((sum, each) => sum + each.duration_s, 0));
      const has = {s: (tenths / 10).toFixed(1), times: made.length, slips: made.length};
      const missing = wanted.filter(([n, unit]) => has[unit] < n);
      const words = missing.map(([n, unit]) => `${has[unit]} of ${n}\u00a0${unit}`);
      const place = this.buttons[kind].querySelector('.progress-words');
      write(place, words.join('\n') || `\u2713 ${wanted[0].join('\u00a0')}`);
      element(`advice-${kind}`).hidden = !missing.length;
    }
    this.showTuning(recordings.filter(({slips}) => slips).length, interrupted);
    this.showRecording();
  }

  showList(recordings) {
    // What is marked as a mistake has no labels to be seen.
    const seen = recordings.filter(({mistaken}) => !mistaken).map(({name}) => name);
    this.traces = new Map(seen.map((name) => [name, this.traces.get(name) ?? this.traceOf(name)]));
    element('recordings').replaceChildren(...recordings.flatMap((each) => this.rowsOf(each)));
    this.loadTraces(this.decided);
  }

  askAbout(recording, type, content) {
    return this.ask(type, {recording, ...content}, element('recordings-frame'));
  }

  rowsOf({name, duration_s: seconds, usable, held_out: isHeldOut, mistaken, note}) {
    const disabled = this.locked, length = `${seconds.toFixed(1)} s`;
    const act = (word, onclick) => button(word, onclick, {ariaLabel: `${word} ${name}`, disabled});
    const remove = act('Delete', () => (
      confirm(`Delete ${name}, ${length}? It cannot be brought back.`)
      && this.askAbout(name, 'delete_recording')));
    const mark = act(mistaken ? 'Count again' : 'Mistake', () => (
      this.askAbout(name, 'mark_recording', {mistaken: !mistaken})));
    const use = isHeldOut ? 'held out' : usable ? 'tuning' : 'not used';
    const buttons = build('span.buttons', mark, remove);
    const row = tableRow([name, length, mistaken ? 'mistake' : use, buttons]);
    if (note) row.firstChild.append(build('p.notice', note));
    const trace = this.traces.get(name);
    trace?.allow(!disabled);
    return trace ? [row, build('tr', build('td', trace.root, {colSpan: 4}))] : [row];
  }

  traceOf(recording) {
    const {finger, connection} = this;
    // The user has not asked for a trace, so its refusal must not replace other words.
    return new RecordingTrace(recording, (type, content) => (type === 'trace'
      ? connection.request(type, {finger, recording})
      : this.askAbout(recording, type, {finger, ...content})));
  }

  // Load the pictures that are missing, or all if the detector decides otherwise now.
  loadTraces(decided) {
    for (const trace of this.traces.values()) {
      if (!trace.loaded || decided !== this.decided) trace.load();
    }
    this.decided = decided;
  }

  showRecording() {
    const {recording, readOnly, connection: {words: lost}} = this;
    if (recording === undefined) return;
    const usable = this.finger in this.labels && !this.locked;
    for (const [kind, button] of Object.entries(this.buttons)) {
      const runs = recording?.finger === this.finger && recording.kind === kind;
      button.ariaPressed = String(Boolean(runs && !recording.ending));
      button.disabled = !usable || (recording !== null && !recording.ending && !runs);
    }
    element('teach-now').classList.toggle('runs', recording !== null && !lost);
    const idle = readOnly ? 'Pages may only look: slip_view was started with --read-only.'
      : 'Nothing is recorded now.';
    const words = recording ? `\u25cf ${recording.words}` : idle;
    write('teach-now', lost ? 'Not connected: what is recorded is not known.' : words);
  }

  // slips: the number of recordings with slips; interrupted: whether an earlier search can go on.
  showTuning(slips, interrupted) {
    const {tuning} = this.latest, locked = this.locked || !(this.finger in this.labels);
    const run = tuning?.finger === this.finger ? tuning : null, runs = Boolean(tuning?.running);
    const {answer = [], table = [], lines = [], failed, changes, kept} = run ?? {};
    element('tune').disabled = locked || runs || slips < LEAST_SLIPS;
    write('tune', interrupted ? 'Go on' : 'Tune');
    element('stop-tuning').disabled = locked || !runs || tuning.stopping;
    Object.assign(element('tuning-progress'), {hidden: !run?.running, value: run?.share ?? 0});
    write('tuning-step', this.stepWords(tuning, run, slips, interrupted));
    write('tuning-failed', failed ? `Tuning failed: ${failed}. What was recorded is kept.` : '');
    write('tuning-answer', answer[0] ?? '');
    write('tuning-worse', answer.slice(1).join(' '));
    element('apply').disabled = locked || runs || !changes;
    write('apply', changes ? `Apply ${changes} values${kept ? ' nevertheless' : ''}` : 'Apply');
    const rowOf = (cells) => Object.assign(tableRow(cells), {className: cells.at(-1)});
    element('compared').replaceChildren(...table.map(rowOf));
    element('tuning-lines').replaceChildren(...lines.map((line) => build('li', line)));
    // Who has pressed Tune sees the result wherever the page is scrolled to.
    if (this.awaits && answer.length) element('tuning-result').scrollIntoView({block: 'nearest'});
    this.awaits &&= !answer.length;
  }

  stepWords(tuning, run, slips, interrupted) {
    if (run?.stopping) return 'stopping; the best result so far is evaluated and kept';
    if (run?.running) return run.step;
    if (tuning?.running) return 'another finger is being tuned';
    if (run?.kept) return '';
    if (run?.answer.length) return 'Done. Save, below, writes what runs after Apply.';
    if (interrupted) return 'A search was interrupted: Go on uses what it has found so far.';
    return slips < LEAST_SLIPS ? 'Tuning needs two slips at least; twenty are good.' : '';
  }
}
