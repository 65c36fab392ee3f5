// Announces changes of the fingers to screen readers, without interrupting them.

// Changes within so many milliseconds are announced together: slip may come and go many times a second.
const GATHERED_MS = 1500;

export class News {
  // region: an element with the role status.
  constructor(region) {
    this.region = region;
    this.announced = new Map();
    this.waiting = new Map();
    this.timer = null;
  }

  // Note the present state of a finger. Slip that has ended before it was announced is still announced.
  tell(label, words) {
    const heard = this.waiting.get(label) ?? [this.announced.get(label)];
    if (heard.at(-1) === words) return;
    // Of the states in between only slip is kept.
    this.waiting.set(label, [...heard.filter((each, i) => i === 0 || each.startsWith('SLIP')), words]);
    this.timer ??= setTimeout(() => this.say(), GATHERED_MS);
  }

  say() {
    this.timer = null;
    const sentences = [];
    for (const [label, [, ...heard]] of this.waiting) {
      const different = heard.filter((words, i) => words !== heard[i - 1]);
      if (different.length > 1 || different[0] !== this.announced.get(label)) {
        sentences.push(`${label}: ${different.join(', then ')}`);
      }
      this.announced.set(label, heard.at(-1));
    }
    this.waiting.clear();
    if (sentences.length) this.region.textContent = `${sentences.join('. ')}.`;
  }
}
