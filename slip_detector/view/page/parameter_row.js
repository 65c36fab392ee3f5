// One parameter: its value to be edited, its unit, what is allowed, and what it means.

import {build, button} from './elements.js';

let rows = 0;

export class ParameterRow {
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

  tellMeanwhile(lead) {
    this.meanwhile = `${lead} meanwhile.`;
    this.notes.textContent = `${this.notes.textContent} ${this.meanwhile}`;
  }

  markRefused(refused) {
    this.field.setAttribute('aria-invalid', String(refused));
  }
}
