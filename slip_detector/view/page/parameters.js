// The parameters of the chosen detector, which decides what is allowed: shown, set, undone, saved.

import {PAGE, Tool, button, partsOf, update, write} from './elements.js';

// The heading of what is changed most often and of the groups: on top, and open at first.
const FIRST_HEADING = 'Threshold and vote';

// What stands before a change in the list, by who has made it.
const LEADS = {
  [`page ${PAGE}`]: 'Set',
  outside: 'Changed by another program',
  restart: 'The detector was started again, with',
};

export class Parameters extends Tool {
  constructor(connection) {
    super(connection, element('parameters-refusal'));
    this.latest = {folder: '', fingers: {}};
    // Values typed but not set yet, by name; null: to be deleted. Those of other fingers are kept.
    this.edits = new Map();
    this.kept = {};
    this.rows = new Map();
    this.sections = element('parameter-values');
    this.search = element('parameter-search');
    this.presets = document.querySelectorAll('#presets [value]');
    connection.on('parameters', (message) => {
      this.latest = message;
      this.show();
    });
    listen('presets', 'click', ({target: {value: preset}}) => (
      preset && this.ask('preset', {preset})));
    listen('parameter-values', 'submit', (event) => this.submit(event));
    listen('discard', 'click', () => {
      this.edits.clear();
      this.refuse('');
      this.show();
    });
    listen('undo', 'click', () => this.ask('undo'));
    listen('as-in-file', 'click', () => this.ask('as_in_file'));
    listen('parameter-search', 'input', () => {
      for (const section of this.sections.children) {
        section.open = Boolean(this.search.value) || section.dataset.heading === FIRST_HEADING;
      }
      this.show();
    });
    listen('add-group', 'click', () => {
      const name = element('group-name').value.trim();
      if (name) this.edit(`groups.${name}`, '');
      element('group-name').value = '';
    });
    listen('saving', 'submit', (event) => this.save(event));
    listen('replace-file', 'click', (event) => this.save(event));
    listen('file-name', 'input', () => (element('replace-file').hidden = true));
  }

  choose(finger) {
    this.keepRows([]);
    this.edits = this.kept[finger] ??= new Map();
    element('saved').textContent = '';
    element('file-name').value = (this.labels[finger] ?? '').replace(/\W+|__+/g, '_');
    super.choose(finger);
  }

  refuse(words) {
    super.refuse(words);
    // Another name that contains that of a parameter does not count.
    const named = words.split(/[\s,;:]+/);
    for (const [name, {field}] of this.rows) field.ariaInvalid = String(named.includes(name));
  }

  show() {
    const {finger, labels: {[finger]: label = finger}} = this, panel = this.latest.fingers[finger];
    if (panel) {
      this.showRows(panel);
      this.showChanges(panel.changes);
    }
    const n = this.edits.size, differs = panel?.differs ?? [];
    write('parameters-state', this.stateWords(panel, label));
    write('set-all', n ? `Set ${n} ${n === 1 ? 'value' : 'values'}` : 'Set');
    write('undoes', panel?.undo ? `Undo takes back: ${panel.undo}.` : '');
    write('as-in-file', panel?.file ? 'As in the file' : 'As first seen');
    write('save-folder', this.latest.folder && `It is written to ${this.latest.folder}`);
    element('as-in-file').title = differs.length ? `Differs: ${differs.join(', ')}` : '';
    const [actions, values, saving] = document.querySelectorAll('#tools fieldset');
    saving.disabled = !panel || this.locked;
    actions.disabled = values.disabled = saving.disabled || panel.gone;
    const enabled = {'set-all': n, discard: n, undo: panel?.undo, 'as-in-file': differs.length};
    for (const [id, on] of Object.entries(enabled)) element(id).disabled = !on;
    for (const each of this.presets) each.ariaPressed = String(each.value === panel?.preset);
  }

  stateWords(panel, label) {
    if (!this.finger) return 'No detector is chosen.';
    if (!panel) return `Waiting for the parameters of ${label}.`;
    return [
      `Of ${label}. Values hold when they are set, all that were changed at once or none.`,
      panel.file && `Its file is ${panel.file}.`,
      panel.gone && 'The detector is gone: these are the values that it had.',
      this.readOnly && 'Pages may only look: slip_view was started with --read-only.',
    ].filter(Boolean).join(' ');
  }

  showRows(panel) {
    const {edits} = this, listed = panel.headings.flatMap(
      ({heading, parameters}) => parameters.map((parameter) => [heading, parameter]));
    const names = new Set(listed.map(([, {name}]) => name));
    for (const [name, text] of edits) {
      // A group to be added has a row, though the detector has no such parameter yet.
      if (!names.has(name) && text === null) edits.delete(name);
      else if (!names.has(name)) listed.push([FIRST_HEADING, {name}]);
    }
    for (const [heading, parameter] of listed) {
      const {name, text} = parameter;
      if (edits.get(name) === text) edits.delete(name);
      this.rowOf(heading, parameter).show(parameter, edits.get(name), panel.file);
    }
    this.keepRows(listed.map(([, {name}]) => name));
    const words = this.search.value.trim().toLowerCase();
    for (const {root} of this.rows.values()) {
      root.hidden = !root.textContent.toLowerCase().includes(words);
    }
  }

  keepRows(names) {
    for (const [name, {root}] of this.rows) {
      if (names.includes(name)) continue;
      root.remove();
      this.rows.delete(name);
    }
  }

  rowOf(heading, parameter) {
    const {name} = parameter;
    if (this.rows.has(name)) return this.rows.get(name);
    let section = [...this.sections.children].find(({dataset}) => dataset.heading === heading);
    if (!section) {
      const parts = [build('summary', heading), build('div.rows')];
      section = build('details', ...parts, {dataset: {heading}});
      this.sections.append(section);
    }
    const row = new ParameterRow(parameter, (text) => this.edit(name, text));
    this.rows.set(name, row);
    section.querySelector('.rows').append(row.root);
    return row;
  }

  // text: what was typed; undefined: keep the detector's value; null: delete the parameter.
  edit(name, text) {
    if (text === undefined) this.edits.delete(name);
    else this.edits.set(name, text);
    this.refuse('');
    this.show();
  }

  // The last changes, the newest below; a list that stays the same is not read aloud again.
  showChanges(changes) {
    const wordsOf = ([, by, words]) => `${LEADS[by] ?? 'Changed on another page'}: ${words}.`;
    const lines = changes.slice(0, 5).reverse().map(wordsOf), list = element('changes');
    if (String(lines) === this.listed) return;
    this.listed = String(lines);
    list.replaceChildren(...lines.map((line) => build('li', line)));
  }

  async submit(event) {
    event.preventDefault();
    const {edits} = this, sent = new Map(edits);
    if (!sent.size) return;
    const {refusal} = await this.ask('set', {values: Object.fromEntries(sent)});
    if (refusal) return;
    for (const [name, text] of sent) if (edits.get(name) === text) edits.delete(name);
    this.show();
  }

  async save(event) {
    event.preventDefault();
    const {fingers: panels} = this.latest, name = element('file-name').value;
    const all = Object.keys(panels).filter((each) => !panels[each].gone);
    const fingers = element('save-scope').value === 'all' ? all : [this.finger];
    const asked = {fingers, name, replace: event.target.id === 'replace-file'};
    const {refusal, launch, taken} = await this.connection.request('save', asked);
    const saved = `ros2 launch slip_detector slip_detector.launch.py ${launch}`;
    const why = refusal || taken;
    element('replace-file').hidden = !taken;
    write('saved', why ? `Not saved: ${why}` : `Saved. ${saved}`);
    element('saved').scrollIntoView({block: 'nearest'});
  }
}

// One parameter: its value to be edited, its unit, what is allowed, and what it means.
class ParameterRow {
  // onEdit(text): the user typed this; undefined: keep the detector's value; null: delete it.
  constructor({name, choices = []}, onEdit) {
    const id = `parameter-${name.replace(/\s/g, '_')}`;
    Object.assign(this, partsOf('parameter'));
    Object.assign(this.label, {textContent: name, htmlFor: id});
    [this.notes.id, this.meaning.id] = [`${id}-notes`, `${id}-meaning`];
    const options = choices.map((choice) => new Option(choice));
    this.field = build(options.length ? 'select' : 'input', ...options, {id, spellcheck: false});
    this.field.setAttribute('aria-describedby', `${id}-notes ${id}-meaning`);
    listen(this.field, 'input', ({target: {value}}) => (
      onEdit(value === this.present ? undefined : value)));
    listen(this.field, 'keydown', ({key}) => key === 'Escape' && onEdit(undefined));
    this.label.after(this.field);
    this.root.dataset.name = name;
    if (name.startsWith('groups.')) {
      const isAbsent = () => this.removed || this.present === undefined;
      this.remove = button('Remove', () => onEdit(isAbsent() ? undefined : null));
      this.unit.after(this.remove);
    }
  }

  // Show the server's description, of a new group its name alone, and what was typed.
  show(parameter, edit, file) {
    const {text, unit = '', allowed, meaning = '', in_file: inFile, read_only: fixed} = parameter;
    const removed = edit === null, where = file ? 'In the file' : 'As first seen';
    Object.assign(this, {present: text, removed});
    update(this.field, {value: edit ?? text});
    write(this.unit, unit);
    write(this.meaning, allowed ? `${meaning} Allowed: ${allowed}.` : meaning);
    const isNew = text === undefined;
    const notes = isNew ? ['New, not set yet: numbers of channels with commas between.'] : [
      fixed && 'Holds from the start: it cannot be changed while the detector runs.',
      edit !== undefined && !removed && `Not set yet; the detector has ${text || 'nothing'}.`,
      removed && 'To be removed.',
      inFile !== null && inFile !== text && `${where}: ${inFile || 'nothing'}.`,
    ];
    write(this.notes, notes.filter(Boolean).join(' '));
    this.root.classList.toggle('edited', edit !== undefined);
    this.root.classList.toggle('removed', removed);
    this.field.disabled = fixed || removed;
    if (this.remove) write(this.remove, removed ? 'Keep' : 'Remove');
  }
}
