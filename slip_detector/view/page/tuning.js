// Tuning on the recordings: progress, the comparison on held-out recordings, apply.

import {build, button, tableRow} from './elements.js';

const LEAST_SLIPS = 2;

export class Tuning {
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
