// Makes the elements of the page. Texts from the robot go into text nodes, never into HTML.

// An element: its kind with its classes, as 'p.hint'; texts and elements that it contains; properties.
export function build(kind, ...parts) {
  const [name, ...classes] = kind.split('.');
  const made = make(name, undefined, classes.join(' '));
  for (const part of parts) {
    if (typeof part === 'string' || part instanceof Node) made.append(part);
    else Object.assign(made, part);
  }
  return made;
}

// A button; properties: those that differ from the usual ones.
export function button(words, act, properties = {}) {
  const made = build('button', words, {type: 'button', ...properties});
  made.addEventListener('click', act);
  return made;
}

// A row of a table: texts and elements, of which the given number are headings of this scope.
export function tableRow(cells, headings, scope) {
  return build('tr', ...cells.map((cell, i) => (i < headings ? build('th', cell, {scope}) : build('td', cell))));
}

// A tab below "Set up": the fingers by their labels, requests, and the line that shows why one was refused.
export class Tool {
  constructor(connection) {
    this.connection = connection;
    this.finger = null;
    this.labels = {};
    this.locked = false;
    this.line = build('p.refusal', {role: 'alert', hidden: true});
    connection.on('fingers', ({fingers, read_only: readOnly}) => {
      this.labels = Object.fromEntries(fingers.map(({name, label}) => [name, label]));
      this.locked = readOnly;
      this.show();
    });
  }

  // Send a request about the chosen finger, or another one; resolves with the refusal, or ''.
  async ask(type, content) {
    this.refuse('');
    const {refusal} = await this.connection.request(type, {finger: this.finger, page: PAGE, ...content});
    if (refusal) this.refuse(refusal);
    return refusal;
  }

  refuse(words) {
    this.line.textContent = words && `Refused: ${words}`;
    this.line.hidden = !words;
  }
}

// Names this page in requests, so that it knows its own changes from those of others.
export const PAGE = crypto.getRandomValues(new Uint32Array(2)).join('-');
