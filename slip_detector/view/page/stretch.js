// The stretch of time that traces show: it goes on with what comes, or stands still to be looked at.
// Times are seconds, as those of the columns.

const WINDOW_S = {least: 0.5, most: 60, first: 10}, LEAST_S = 0.02;
// The newest column is drawn so much after its time, so that there is always one to be drawn.
const DELAY_S = 0.08;
// Columns come unevenly. The axis goes on evenly, and by this share of the way to the newest with each
// that comes; but it is never further from it: where nothing comes, it stands.
const FOLLOWED_SHARE = 0.04, MOST_APART_S = 0.4;

const within = (value, least, most) => Math.min(Math.max(value, least), most);

export class Stretch {
  constructor() {
    this.window_s = WINDOW_S.first;
    this.begin();
  }

  // Of a finger of which nothing has come yet.
  begin() {
    this.columns = null;
    this.goOn();
  }

  // What it is a stretch of; goesOn: with the times of what it was before.
  of(columns, goesOn) {
    this.columns = columns;
    if (!goesOn) this.offset = null;
  }

  goOn(window_s = this.window_s) {
    // Where it was live before, a longer stretch ends where the shorter one did.
    if (!this.live || !this.columns) this.offset = null;
    this.live = true;
    this.pauses = false;
    this.window_s = within(window_s, WINDOW_S.least, WINDOW_S.most);
  }

  pause() {
    // Before anything has come: as soon as it has.
    this.pauses = this.columns?.last_s == null;
    if (this.pauses) return;
    [this.from, this.to] = this.ends();
    this.live = false;
    this.window_s = this.to - this.from;
    this.held_s = this.columns.last_s;
  }

  pauseOrGoOn() {
    if (this.live && !this.pauses) this.pause();
    else this.goOn();
  }

  // Show another stretch; how: as Timeline has it.
  look(from, to, how) {
    if (how === 'whole') this.goOn(WINDOW_S.first);
    else if (how === 'zoom' && this.live) this.goOn(to - from);
    else this.lookBack(from, to);
  }

  lookBack(from, to) {
    if (this.live) this.pause();
    if (this.live) return;
    const span = within(to - from, LEAST_S, WINDOW_S.most), end = (from + to + span) / 2;
    // Nothing lies after the pause began, nor longer ago than is kept.
    this.to = Math.min(Math.max(end, this.held_s - WINDOW_S.most + span), this.held_s + 0.05 * span);
    this.from = this.to - span;
    this.window_s = span;
  }

  // Note that a newer column has come.
  follow() {
    if (this.offset !== null) this.offset += FOLLOWED_SHARE * (this.ahead() - this.offset);
  }

  // How far the newest column that is drawn is ahead of this computer's clock.
  ahead() {
    return this.columns.last_s - DELAY_S - performance.now() / 1000;
  }

  // From when to when is shown.
  ends() {
    if (!this.live) return [this.from, this.to];
    const {columns, window_s} = this;
    if (columns?.last_s == null) return [0, window_s];
    const ahead = this.ahead();
    this.offset = within(this.offset ?? ahead, ahead - MOST_APART_S, ahead + MOST_APART_S);
    // Whole columns, so that each is drawn the same way wherever it is.
    const to = Math.floor((performance.now() / 1000 + this.offset) / columns.width_s) * columns.width_s;
    return [to - window_s, to];
  }
}
