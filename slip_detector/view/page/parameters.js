// The parameters of the chosen detector: show, set together, undo, restore those of the file, save.
// The detector decides what is allowed; its message is shown as it is.

import {PAGE, Tool, button, write} from './elements.js';

// The heading of what is changed most often, which stands on top and is open at first, as groups do.
const OF_GROUPS = 'Threshold and vote';

export class Parameters extends Tool {
  constructor(connection) {
    super(connection, element('parameters-refusal'));
    this.latest = {folder: '', fingers: {}};
    // By finger: values typed but not set yet, by name (null: to be deleted); and the number of the
    // last change that was shown.
    this.edits = new Map();
    this.lastChange = new Map();
    this.rows = new Map();
    this.sections = element('parameter-values');
    this.search = element('parameter-search');
    this.presets = [...document.querySelectorAll('#presets [value]')];
    for (const one of this.presets) one.addEventListener('click', () => this.ask('preset', {preset: one.value}));
    connection.on('parameters', (message) => {
      this.latest = message;
      this.show();
    });
    const on = (id, kind, act) => element(id).addEventListener(kind, (event) => {
      if (kind === 'submit') event.preventDefault();
      act();
    });
    on('parameter-values', 'submit', () => this.submit());
    on('discard', 'click', () => {
      this.edits.delete(this.finger);
      this.refuse('');
      this.show();
    });
    on('undo', 'click', () => this.ask('undo'));
    on('as-in-file', 'click', () => this.ask('as_in_file'));
    on('parameter-search', 'input', () => {
      for (const section of this.sections.children) section.open = Boolean(this.search.value) || section.dataset.heading === OF_GROUPS;
      this.show();
    });
    on('add-group', 'click', () => {
      const name = element('group-name').value.trim();
      if (name) this.edit(`groups.${name}`, '');
      element('group-name').value = '';
    });
    on('saving', 'submit', () => this.write(false));
    on('replace-file', 'click', () => this.write(true));
    on('file-name', 'input', () => (element('replace-file').hidden = true));
  }

  // What was typed for another finger stays.
  choose(finger) {
    this.keepRows([]);
    element('changes').replaceChildren();
    element('saved').textContent = '';
    element('file-name').value = (this.labels[finger] ?? '').replace(/\W+|__+/g, '_');
    super.choose(finger);
  }

  refuse(words) {
    super.refuse(words);
    // Another name that contains that of a parameter does not count.
    const named = words.split(/[\s,;:]+/);
    for (const [name, {field}] of this.rows) field.setAttribute('aria-invalid', String(named.includes(name)));
  }

  show() {
    const panel = this.latest.fingers[this.finger], label = this.labels[this.finger] ?? this.finger;
    const usable = Boolean(panel) && !panel.gone && !this.locked;
    const edits = this.edits.get(this.finger) ?? new Map();
    if (panel) {
      this.showRows(panel, edits, usable);
      this.showChanges(panel);
    }
    const n = edits.size, differs = panel?.differs ?? [];
    write('parameters-state', this.stateWords(panel, label));
    write('set-all', n ? `Set ${n} ${n === 1 ? 'value' : 'values'}` : 'Set');
    write('undoes', panel?.undo ? `Undo takes back: ${panel.undo}.` : '');
    write('as-in-file', panel?.file ? 'As in the file' : 'As first seen');
    write('save-folder', this.latest.folder && `It is written to ${this.latest.folder}`);
    element('as-in-file').title = differs.length ? `Differs: ${differs.join(', ')}` : 'Nothing differs';
    const enabled = {
      'set-all': usable && n, discard: n, undo: usable && panel.undo, 'as-in-file': usable && differs.length,
      save: panel && !this.locked, 'replace-file': panel && !this.locked, 'group-name': usable, 'add-group': usable,
    };
    for (const [id, on] of Object.entries(enabled)) element(id).disabled = !on;
    for (const one of this.presets) Object.assign(one, {disabled: !usable, ariaPressed: String(one.value === panel?.preset)});
  }

  stateWords(panel, label) {
    if (!panel) return this.finger ? `Waiting for the parameters of ${label}.` : 'No detector is chosen.';
    const words = [`Of ${label}. Values hold when they are set, all that were changed at once or none.`];
    if (panel.file) words.push(`Its file is ${panel.file}.`);
    if (panel.gone) words.push('The detector is gone: these are the values that it had.');
    if (this.readOnly) words.push('Nothing can be changed from here: slip_view was started with --read-only.');
    return words.join(' ');
  }

  showRows(panel, edits, usable) {
    const shown = panel.headings.flatMap(({heading, parameters}) => parameters.map((parameter) => [heading, parameter]));
    const names = new Set(shown.map(([, {name}]) => name));
    for (const [name, text] of edits) {
      // A group to be added has a row, though the detector has no such parameter yet.
      if (!names.has(name) && text === null) edits.delete(name);
      else if (!names.has(name)) shown.push([OF_GROUPS, {name}]);
    }
    for (const [heading, parameter] of shown) {
      const {name, text} = parameter;
      if (edits.get(name) === text) edits.delete(name);
      this.rowOf(heading, parameter).show(parameter, edits.get(name), usable, panel.file);
    }
    this.keepRows(shown.map(([, {name}]) => name));
    const words = this.search.value.trim().toLowerCase();
    for (const {root} of this.rows.values()) root.hidden = !root.textContent.toLowerCase().includes(words);
  }

  // Remove the rows of all other names.
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
    section ??= this.sections.appendChild(build('details', build('summary', heading), build('div.rows')));
    section.dataset.heading = heading;
    const row = new ParameterRow(parameter, (text) => this.edit(name, text));
    this.rows.set(name, row);
    section.querySelector('.rows').append(row.root);
    return row;
  }

  // text: what was typed; undefined: keep the detector's value; null: delete the parameter.
  edit(name, text) {
    const edits = this.edits.get(this.finger) ?? new Map();
    this.edits.set(this.finger, edits);
    if (text === undefined) edits.delete(name);
    else edits.set(name, text);
    this.refuse('');
    this.show();
  }

  showChanges(panel) {
    const newest = panel.changes[0]?.[0] ?? 0;
    // After a restart, slip_view counts changes from the beginning.
    const last = Math.min(this.lastChange.get(this.finger) ?? newest, newest), list = element('changes');
    this.lastChange.set(this.finger, newest);
    for (const [, by, words] of panel.changes.filter(([number]) => number > last).reverse()) {
      const lead = {
        [`page ${PAGE}`]: 'Set', outside: 'Changed by another program', restart: 'The detector was started again, with',
      }[by] ?? 'Changed on another page';
      list.append(build('li', `${lead}: ${words}.`));
      if (list.children.length > 5) list.firstChild.remove();
    }
  }

  async submit() {
    const edits = this.edits.get(this.finger);
    if (!edits?.size || element('set-all').disabled) return;
    const sent = new Map(edits);
    const {refusal} = await this.ask('set', {values: Object.fromEntries(sent)});
    if (refusal) return;
    for (const [name, text] of sent) if (edits.get(name) === text) edits.delete(name);
    this.show();
  }

  async write(replace) {
    const all = Object.keys(this.latest.fingers).filter((name) => !this.latest.fingers[name].gone);
    const fingers = element('save-scope').value === 'all' ? all : [this.finger], name = element('file-name').value;
    const {refusal, launch, taken} = await this.connection.request('save', {fingers, name, replace});
    element('replace-file').hidden = !taken;
    element('saved').textContent = refusal || taken
      ? `Not saved: ${refusal || taken}` : `Saved. ros2 launch slip_detector slip_detector.launch.py ${launch}`;
    element('saved').scrollIntoView({block: 'nearest'});
  }
}

// One parameter: its value to be edited, its unit, what is allowed, and what it means.
class ParameterRow {
  // onEdit(text): the user typed this; undefined: keep the detector's value; null: delete the parameter.
  constructor({name, choices = []}, onEdit) {
    const id = `parameter-${name.replace(/\s/g, '_')}`;
    this.root = element('parameter').content.firstElementChild.cloneNode(true);
    [this.label, this.unit, this.notes, this.meaning] = this.root.children;
    Object.assign(this.label, {textContent: name, htmlFor: id});
    [this.notes.id, this.meaning.id] = [`${id}-notes`, `${id}-meaning`];
    this.field = build(choices.length ? 'select' : 'input', ...choices.map((choice) => new Option(choice)), {
      id, spellcheck: false, autocomplete: 'off',
    });
    this.field.setAttribute('aria-describedby', `${id}-notes ${id}-meaning`);
    this.field.addEventListener('input', () => onEdit(this.field.value === this.present ? undefined : this.field.value));
    this.field.addEventListener('keydown', ({key}) => key === 'Escape' && onEdit(undefined));
    this.label.after(this.field);
    this.root.dataset.name = name;
    if (name.startsWith('groups.')) {
      this.remove = button('Remove', () => onEdit(this.removed || this.present === undefined ? undefined : null));
      this.unit.after(this.remove);
    }
  }

  // Show the server's description, of a new group its name alone. edit: what was typed; undefined: nothing;
  // null: delete the parameter.
  show({text, unit = '', allowed, meaning = '', in_file: inFile, read_only: fixed}, edit, usable, file) {
    this.present = text;
    this.removed = edit === null;
    const wanted = edit ?? text, {removed} = this;
    if (this.field.value !== wanted) this.field.value = wanted;
    this.unit.textContent = unit;
    this.meaning.textContent = allowed ? `${meaning} Allowed: ${allowed}.` : meaning;
    this.notes.textContent = text === undefined ? 'New, not set yet: numbers of channels with commas between.' : [
      fixed && 'Holds from the start: it cannot be changed while the detector runs.',
      edit !== undefined && !removed && `Not set yet; the detector has ${text || 'nothing'}.`,
      removed && 'To be removed.',
      inFile !== null && inFile !== text && `${file ? 'In the file' : 'As first seen'}: ${inFile || 'nothing'}.`,
    ].filter(Boolean).join(' ');
    this.root.classList.toggle('edited', edit !== undefined);
    this.root.classList.toggle('removed', removed);
    this.field.disabled = !usable || fixed || removed;
    const words = removed ? 'Keep' : 'Remove';
    if (this.remove) Object.assign(this.remove, {disabled: !usable, textContent: words});
  }
}
