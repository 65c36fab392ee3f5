// The parameters of the chosen detector: show, set together, undo, restore those of the file, save.
// The detector decides what is allowed; its message is shown as it is.

import {PAGE, Tool, build, button, write} from './elements.js';

// The heading of the groups, and the headings that are open at first: the values changed most often.
const OF_GROUPS = 'Threshold and vote';
const OPEN = new Set(['Filters', OF_GROUPS]);

// Whether words name a parameter; another name that contains this one does not count.
const isNamed = (name, words) => words.split(/[\s,;:]+/).includes(name);

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
    connection.on('parameters', (message) => {
      this.latest = message;
      this.show();
    });
    const on = (id, kind, act) => element(id).addEventListener(kind, (event) => {
      if (kind === 'submit') event.preventDefault();
      act();
    });
    on('parameter-values', 'submit', () => this.submit());
    on('discard', 'click', () => this.forget());
    on('undo', 'click', () => this.ask('undo'));
    on('as-in-file', 'click', () => this.ask('as_in_file'));
    on('saving', 'submit', () => this.write(false));
    on('replace-file', 'click', () => this.write(true));
    on('file-name', 'input', () => (element('replace-file').hidden = true));
  }

  // Show the parameters of this finger; what was typed for another one stays.
  choose(finger) {
    if (finger === this.finger) return;
    this.finger = finger;
    this.refuse('');
    this.rows.clear();
    this.sections.replaceChildren();
    element('changes').replaceChildren();
    element('saved').textContent = '';
    element('file-name').value = (this.labels[finger] ?? '').replace(/\W+|__+/g, '_');
    this.show();
  }

  // Set parameters of a finger, all or none: values by name, texts as they were typed or numbers.
  // Resolves with the refusal, or ''.
  set(finger, values) {
    return this.ask('set', {finger, values});
  }

  refuse(words) {
    super.refuse(words);
    for (const [name, row] of this.rows) row.markRefused(isNamed(name, words));
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
      save: panel && !this.locked, 'replace-file': panel && !this.locked,
    };
    for (const [id, on] of Object.entries(enabled)) element(id).disabled = !on;
  }

  stateWords(panel, label) {
    if (!panel) return this.finger ? `Waiting for the parameters of ${label}.` : 'No detector is chosen.';
    const words = [`Of ${label}. Values hold when they are set, all that were changed at once or none.`];
    if (panel.file) words.push(`Its file is ${panel.file}.`);
    if (panel.gone) words.push('The detector is gone: these are the values that it had.');
    if (this.locked) words.push('Nothing can be changed from here: slip_view was started with --read-only.');
    return words.join(' ');
  }

  showRows(panel, edits, usable) {
    const seen = new Set();
    for (const {heading, parameters} of panel.headings) {
      const section = this.sectionOf(heading);
      for (const parameter of parameters) {
        seen.add(parameter.name);
        if (edits.get(parameter.name) === parameter.text) edits.delete(parameter.name);
        this.rowOf(parameter, section).show(parameter, edits.get(parameter.name), usable);
      }
    }
    // A group to be added has a row, though the detector has no such parameter yet.
    for (const [name, text] of edits) {
      if (seen.has(name) || text === null) continue;
      seen.add(name);
      this.rowOf({name}, this.sectionOf(OF_GROUPS)).showNew(text, usable);
    }
    for (const [name, row] of this.rows) {
      if (seen.has(name)) continue;
      row.root.remove();
      this.rows.delete(name);
      edits.delete(name);
    }
    for (const add of this.sections.querySelectorAll('.add-group :is(input, button)')) add.disabled = !usable;
  }

  sectionOf(heading) {
    const found = [...this.sections.children].find((section) => section.dataset.heading === heading);
    if (found) return found;
    const section = build('details', build('summary', heading), build('div.rows'), {open: OPEN.has(heading)});
    section.dataset.heading = heading;
    if (heading === OF_GROUPS) section.append(this.buildAddGroup());
    this.sections.append(section);
    return section;
  }

  buildAddGroup() {
    const name = build('input', {placeholder: 'name'});
    const add = button('Add', () => {
      if (!name.value.trim()) return;
      this.edit(`groups.${name.value.trim()}`, '');
      name.value = '';
    });
    return build('p.add-group', build('label', 'New group ', name), add);
  }

  rowOf(parameter, section) {
    const {name} = parameter;
    if (!this.rows.has(name)) {
      const row = new ParameterRow(parameter, (text) => this.edit(name, text));
      this.rows.set(name, row);
      section.querySelector('.rows').append(row.root);
    }
    return this.rows.get(name);
  }

  // text: what was typed; undefined: keep the detector's value; null: delete the parameter.
  edit(name, text) {
    const edits = this.edits.get(this.finger) ?? new Map();
    this.edits.set(this.finger, edits);
    if (text === undefined) edits.delete(name);
    else edits.set(name, text);
    this.show();
  }

  showChanges(panel) {
    const newest = panel.changes[0]?.number ?? 0;
    // After a restart, slip_view counts changes from the beginning.
    const last = Math.min(this.lastChange.get(this.finger) ?? newest, newest), list = element('changes');
    this.lastChange.set(this.finger, newest);
    for (const {by, words, names} of panel.changes.filter(({number}) => number > last).reverse()) {
      const lead = {
        [`page ${PAGE}`]: 'Set', outside: 'Changed by another program', restart: 'The detector was started again, with',
      }[by] ?? 'Changed on another page';
      list.append(build('li', `${lead}: ${words}.`));
      if (list.children.length > 5) list.firstChild.remove();
      // A value that somebody else has set is mentioned beside the one typed here.
      for (const name of lead === 'Set' ? [] : names) this.rows.get(name)?.noteMeanwhile(lead);
    }
  }

  async submit() {
    const edits = this.edits.get(this.finger);
    if (!edits?.size || element('set-all').disabled) return;
    const sent = new Map(edits);
    const refusal = await this.set(this.finger, Object.fromEntries(sent));
    if (refusal) return;
    for (const [name, text] of sent) if (edits.get(name) === text) edits.delete(name);
    this.show();
  }

  forget() {
    this.edits.delete(this.finger);
    this.refuse('');
    this.show();
  }

  async write(replace) {
    const all = Object.keys(this.latest.fingers).filter((name) => !this.latest.fingers[name].gone);
    const fingers = element('save-scope').value === 'all' ? all : [this.finger], name = element('file-name').value;
    const {refusal, launch, taken} = await this.connection.request('save', {fingers, name, replace});
    element('replace-file').hidden = !taken;
    element('saved').textContent = refusal || taken
      ? `Not saved: ${refusal || taken}` : `Saved. ros2 launch slip_detector slip_detector.launch.py ${launch}`;
  }
}

// One parameter: its value to be edited, its unit, what is allowed, and what it means.
let rows = 0;

class ParameterRow {
  // onEdit(text): the user typed this; undefined: keep the detector's value; null: delete the parameter.
  constructor({name, choices = []}, onEdit) {
    const id = `parameter-${++rows}`;
    this.label = build('label', name, {htmlFor: id});
    this.field = build(choices.length ? 'select' : 'input', ...choices.map((choice) => new Option(choice)), {
      id, spellcheck: false, autocomplete: 'off',
    });
    this.unit = build('span.unit');
    this.notes = build('p.notes', {id: `${id}-notes`});
    this.meaning = build('p.hint', {id: `${id}-meaning`});
    this.field.setAttribute('aria-describedby', `${this.notes.id} ${this.meaning.id}`);
    this.field.addEventListener('input', () => onEdit(this.field.value === this.present ? undefined : this.field.value));
    this.field.addEventListener('keydown', ({key}) => {
      if (key === 'Escape') onEdit(undefined);
    });
    this.root = build('div.parameter', this.label, this.field, this.unit);
    this.root.dataset.name = name;
    if (name.startsWith('groups.')) {
      this.remove = button('Remove', () => onEdit(this.removed || this.present === undefined ? undefined : null));
      this.root.append(this.remove);
    }
    this.root.append(this.notes, this.meaning);
  }

  // Show the server's description. edit: what was typed; undefined: nothing; null: delete the parameter.
  show({text, unit, allowed, meaning, in_file: inFile, read_only: fixed}, edit, usable) {
    if (edit === undefined) this.meanwhile = '';
    this.present = text;
    this.removed = edit === null;
    const wanted = edit ?? text;
    if (this.field.value !== wanted) this.field.value = wanted;
    this.unit.textContent = unit;
    this.meaning.textContent = allowed ? `${meaning} Allowed: ${allowed}.` : meaning;
    this.fixed = fixed;
    this.notes.textContent = [
      fixed && 'Holds from the start: it cannot be changed while the detector runs.',
      edit !== undefined && !this.removed && `Not set yet; the detector has ${text || 'nothing'}.`,
      this.removed && 'To be removed.',
      this.meanwhile,
      inFile !== null && inFile !== text && `In the file: ${inFile || 'nothing'}.`,
    ].filter(Boolean).join(' ');
    this.mark(edit !== undefined, usable && !fixed);
  }

  showNew(text, usable) {
    this.present = undefined;
    if (this.field.value !== text) this.field.value = text;
    this.notes.textContent = 'New, not set yet: numbers of channels with commas between.';
    this.mark(true, usable);
  }

  mark(edited, usable) {
    this.root.classList.toggle('edited', edited);
    this.root.classList.toggle('removed', Boolean(this.removed));
    this.field.disabled = !usable || Boolean(this.removed);
    if (this.remove) {
      this.remove.disabled = !usable;
      this.remove.textContent = this.removed ? 'Keep' : 'Remove';
    }
  }

  // Note that somebody else has changed a value that is being edited.
  noteMeanwhile(lead) {
    if (!this.root.classList.contains('edited')) return;
    this.meanwhile = `${lead} meanwhile.`;
    this.notes.textContent += ` ${this.meanwhile}`;
  }

  markRefused(refused) {
    this.field.setAttribute('aria-invalid', String(refused));
  }
}
