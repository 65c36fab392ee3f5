// Tuning on the recordings: progress, the comparison on held-out recordings, apply.

const LEAST_SLIPS = 2;

export class Tuning {
  // root: an empty element. ask(type, content): sends a request; resolves with the refusal, or ''.
  constructor(root, ask) {
    this.ask = ask;
    const button = (text, act) => {
      const made = make('button', text);
      made.type = 'button';
      made.addEventListener('click', act);
      return made;
    };
    const title = make('h3', 'Tune');
    this.begin = button('Tune', () => this.ask('tune'));
    this.stop = button('Stop, keep what was found', () => this.ask('stop_tuning'));
    this.progress = make('progress');
    this.progress.ariaLabel = 'Progress of the search';
    this.step = make('p', '', 'tuning-step');
    this.step.role = 'status';
    this.failed = make('p', '', 'refusal');
    this.failed.role = 'alert';
    this.lines = make('ul', undefined, 'hint');
    this.table = make('table', undefined, 'compared');
    const buttons = make('div', undefined, 'buttons');
    buttons.append(this.begin, this.stop);
    this.result = make('div');
    this.apply = button('Apply', () => this.ask('apply_tuning'));
    this.result.append(this.table, this.apply);
    root.append(title, buttons, this.progress, this.step, this.failed, this.lines, this.result);
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
    this.lines.replaceChildren(...(mine?.lines ?? []).map((line) => make('li', line)));
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
    const head = make('tr');
    head.append(...['', 'as it runs', 'tuned', ''].map((title) => {
      const cell = make(title ? 'th' : 'td', title);
      if (title) cell.scope = 'col';
      return cell;
    }));
    const thead = make('thead'), tbody = make('tbody');
    thead.append(head);
    tbody.append(...rows.map(([title, before, after, change]) => {
      const row = make('tr', undefined, change), name = make('th', title);
      name.scope = 'row';
      row.append(name, make('td', before), make('td', after), make('td', change && `${change === 'better' ? '▲' : '▽'} ${change}`));
      return row;
    }));
    this.table.replaceChildren(make('caption', 'On what was held out'), thead, tbody);
  }
}
