// Teaching: record rest, slips, taps and presses, tune the detector on them, apply and save. The recordings are
// on the server; this page only shows them, and may be closed at any time.

import {Tool, button, holdable, tableRow, write} from './elements.js';
import {RecordingTrace} from './recording_trace.js';

// Period, in milliseconds, at which the page reports that a slip is held; the server ends the slip
// when the reports stop.
const PRESSED_MS = 200;

// What to record of each kind.
const WANTED = {rest: {recordings: 2, seconds: 60}, slip: {recordings: 20, seconds: 0}, taps: {recordings: 2, seconds: 60}, press: {recordings: 2, seconds: 60}};
const KIND_OF = {r: 'rest', t: 'taps', s: 'press'};
const LEAST_SLIPS = 2;
const NOT_BETTER = 'Nothing better was found';

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
    this.listen();
    connection.on('parameters', ({fingers}) => this.loadTraces(fingers[this.finger]?.changes[0]?.[0] ?? ''));
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

  choose(finger) {
    this.release();
    this.traces.clear();
    super.choose(finger);
    this.refresh();
  }

  refresh() {
    if (this.finger) this.connection.request('recordings', {finger: this.finger});
  }

  listen() {
    for (const kind of Object.values(KIND_OF)) this.buttons[kind].addEventListener('click', () => this.toggle(kind));
    for (const [id, type] of [['tune', 'tune'], ['stop-tuning', 'stop_tuning'], ['apply', 'apply_tuning']]) {
      element(id).addEventListener('click', () => {
        const why = id === 'apply' && this.latest.tuning?.kept;
        if (!why || confirm(`${NOT_BETTER}: ${why}. Apply it nevertheless?`)) this.ask(type, {}, element(id));
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
    if (this.buttons[kind].disabled) return;
    this.teach(this.recording?.kind === kind ? 'stop' : kind);
  }

  press() {
    if (this.pressed !== null || this.buttons.slip.disabled) return;
    this.pressed = setInterval(() => this.connection.request('teach', {do: 'still_pressed'}), PRESSED_MS);
    this.teach('slip').then(({refusal}) => {
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
    return this.ask('teach', {do: what}, element('teach-now'));
  }

  show() {
    const {recordings = [], held_out: heldOut, folder} = this.latest.fingers[this.finger] ?? {};
    // After a restart, the server has not listed the recordings yet.
    if (this.finger in this.labels && !(this.finger in this.latest.fingers)) this.refresh();
    write('teach-words', this.latest.words);
    write('recordings-folder', folder ? `In ${folder}. A third of each kind is held out, see below: the search does not see these, and is judged by them.` : '');
    const shown = JSON.stringify([recordings, heldOut, this.locked]);
    if (shown !== this.shown) this.showList(recordings, heldOut);
    this.shown = shown;
    for (const [kind, wanted] of Object.entries(WANTED)) {
      const some = recordings.filter((one) => one.kind === kind && one.usable);
      const seconds = some.reduce((sum, {duration_s: s}) => sum + s, 0);
      const done = some.length >= wanted.recordings && seconds >= wanted.seconds;
      this.buttons[kind].querySelector('.progress-words').textContent = `${some.length} of ${wanted.recordings}`
        + `${wanted.seconds ? `, ${Math.round(seconds)}\u00a0s` : ''}${done ? ' \u2713' : ''}`;
    }
    this.showTuning(recordings.filter(({slips}) => slips).length);
    this.showRecording();
  }

  showList(recordings, heldOut) {
    element('recordings-frame').hidden = !recordings.length;
    element('recordings').replaceChildren(...recordings.flatMap(({name, duration_s: seconds, slips, usable, note}) => {
      const remove = button('Delete', () => {
        if (confirm(`Delete ${name}, ${seconds.toFixed(1)} s? It cannot be brought back.`)) this.ask('delete_recording', {recording: name}, element('recordings-frame'));
      }, {ariaLabel: `Delete ${name}`, disabled: this.locked});
      if (!this.traces.has(name)) this.traces.set(name, this.traceOf(name));
      this.traces.get(name).allow(!this.locked);
      const row = tableRow([name, `${seconds.toFixed(1)} s`, String(slips), heldOut.includes(name) ? 'held out' : usable ? 'tuning' : 'not used', remove]);
      if (note) row.firstChild.append(build('p.notice', note));
      return [row, build('tr', build('td', this.traces.get(name).root, {colSpan: 5}))];
    }));
    for (const name of this.traces.keys()) if (!recordings.some((one) => one.name === name)) this.traces.delete(name);
    this.loadTraces(this.decided);
  }

  traceOf(recording) {
    const {finger} = this;
    return new RecordingTrace(recording, (type, content) => {
      const request = {finger, recording, ...content};
      // What nobody has asked for is not refused in words that take the place of others.
      return type === 'trace' ? this.connection.request(type, request) : this.ask(type, request, element('recordings-frame'));
    });
  }

  // Load the pictures that are missing, or all if the detector decides otherwise now.
  loadTraces(decided) {
    for (const trace of this.traces.values()) if (!trace.loaded || decided !== this.decided) trace.load();
    this.decided = decided;
  }

  showRecording() {
    const {recording} = this, mine = recording?.finger === this.finger;
    if (recording === undefined) return;
    // A refusal is about what went on then.
    const busy = JSON.stringify([recording?.name, this.latest.tuning?.running]);
    if (busy !== this.busy) this.refuse('');
    this.busy = busy;
    const usable = this.finger in this.labels && !this.locked;
    for (const [kind, button] of Object.entries(this.buttons)) {
      const its = mine && recording.kind === kind;
      button.ariaPressed = String(Boolean(its && !recording.ending));
      button.disabled = !usable || (recording !== null && !recording.ending && !its);
    }
    const {words: lost} = this.connection;
    element('teach-now').classList.toggle('runs', recording !== null && !lost);
    write('teach-now', lost ? 'Not connected: what is recorded is not known.' : recording ? this.recordingWords(recording, mine)
      : this.readOnly ? 'Pages may only look: slip_view was started with --read-only.' : 'Nothing is recorded now.');
  }

  recordingWords({name, finger, seconds, slipping, ending, silent}, mine) {
    const where = mine ? '' : ` of ${this.labels[finger] ?? finger}`;
    const what = slipping ? ', SLIP' : ending ? ', the rest after it: hold still' : '';
    return `\u25cf ${name}${where}: ${seconds.toFixed(1)} s${what}${silent && `. ${silent}`}`;
  }

  // Tuning on the recordings: progress, the comparison on held-out recordings. slips: the number of
  // recordings with slips.
  showTuning(slips) {
    const {tuning} = this.latest, locked = this.locked || !(this.finger in this.labels);
    const mine = tuning?.finger === this.finger ? tuning : null, runs = Boolean(tuning?.running), progress = element('tuning-progress');
    element('tune').disabled = locked || runs || slips < LEAST_SLIPS;
    element('stop-tuning').disabled = locked || !runs || tuning.stopping;
    progress.hidden = !mine?.running;
    if (mine?.running && mine.share) progress.value = mine.share;
    else progress.removeAttribute('value');
    write('tuning-step', this.stepWords(tuning, mine, slips));
    write('tuning-failed', mine?.failed ? `Tuning failed: ${mine.failed}. What was recorded is kept.` : '');
    element('tuning-failed').hidden = !mine?.failed;
    element('tuning-lines').replaceChildren(...(mine?.lines ?? []).map((line) => build('li', line)));
    const rows = mine?.table ?? [];
    element('tuning-result').hidden = !rows.length;
    element('compared').replaceChildren(...rows.map(([title, before, after, change]) => {
      const row = tableRow([title, before, after, change && `${change === 'better' ? '\u25b2' : '\u25bd'} ${change}`]);
      row.className = change;
      return row;
    }));
    element('apply').disabled = locked || runs || !mine?.changes;
    write('apply', mine?.changes ? `Apply ${mine.changes} values${mine.kept ? ' nevertheless' : ''}` : 'Apply');
  }

  stepWords(tuning, mine, slips) {
    if (mine?.stopping) return 'stopping; the best result so far is evaluated and kept';
    if (mine?.running) return mine.step;
    if (tuning?.running) return 'another finger is being tuned';
    if (mine?.table.length) {
      if (mine.kept) return `${NOT_BETTER}: ${mine.kept}. The detector stays as it is.`;
      return mine.changes ? 'Done. Apply sets the running detector; Save, below, writes what it runs with.' : `${NOT_BETTER}: the detector is as good as it was.`;
    }
    return slips < LEAST_SLIPS ? 'Tuning needs two slips at least; twenty are good.' : '';
  }
}
