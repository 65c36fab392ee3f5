// What a screen reader is told by itself: changes of the fingers, in words, politely.

// So many milliseconds of changes are told at once: slip may come and go many times a second.
const GATHERED_MS = 1500;

export class News {
  // region: an element with the role status.
  constructor(region) {
    this.region = region;
    this.told = new Map();
    this.waiting = new Map();
    this.timer = null;
  }

  // How a finger is now. Slip that is over again before it was told is told all the same.
  tell(label, words) {
    const heard = this.waiting.get(label) ?? [this.told.get(label)];
    if (heard.at(-1) === words) return;
    // What the finger was like in between is of no interest unless it slipped.
    this.waiting.set(label, [...heard.filter((each, i) => i === 0 || each.startsWith('SLIP')), words]);
    this.timer ??= setTimeout(() => this.say(), GATHERED_MS);
  }

  say() {
    this.timer = null;
    const sentences = [];
    for (const [label, [, ...heard]] of this.waiting) {
      const different = heard.filter((words, i) => words !== heard[i - 1]);
      if (different.length > 1 || different[0] !== this.told.get(label)) {
        sentences.push(`${label}: ${different.join(', then ')}`);
      }
      this.told.set(label, heard.at(-1));
    }
    this.waiting.clear();
    if (sentences.length) this.region.textContent = `${sentences.join('. ')}.`;
  }
}
