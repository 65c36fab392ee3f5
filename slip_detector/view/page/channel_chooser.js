// Which channels of a finger have traces: a button for each, under its group.

import {build, button} from './elements.js';

// Most channels that the server sends at once.
const MOST_CHANNELS = 64;

export class ChannelChooser {
  // onChoose(): called when other channels are chosen.
  constructor(onChoose) {
    this.onChoose = onChoose;
    this.root = build('div.chooser', {role: 'group', ariaLabel: 'Channels with traces'});
    // The chosen channels, counted from 1, in order; and those last chosen for each finger, by name.
    this.channels = [];
    this.kept = new Map();
  }

  // Show the channels of a finger: those that were chosen before, else its first group.
  show({name, channels, groups, disabled}) {
    const described = JSON.stringify([name, channels, groups, disabled]);
    if (described === this.described) return;
    this.described = described;
    this.name = name;
    const kept = this.kept.get(name) ?? [];
    const chosen = kept.length && kept.at(-1) <= channels.length ? kept : (Object.values(groups)[0] ?? [1]).slice(0, 4);
    this.fill(channels, groups, disabled);
    this.take(chosen);
  }

  fill(channels, groups, disabled) {
    const grouped = new Set(Object.values(groups).flat());
    const left = channels.map((_, c) => c + 1).filter((c) => !grouped.has(c) && !disabled.includes(c));
    const sets = [...Object.entries(groups), ...(left.length ? [['no group', left]] : [])];
    this.root.replaceChildren(...sets.map(([name, members]) => {
      const whole = button(name, () => this.choose(members), {className: 'whole-set', title: `The traces of ${name} and of no other`});
      return build('span.channel-set', whole, ...members.map((c) => {
        const one = button(String(c), () => this.toggle(c), {ariaLabel: `Traces of ${channels[c - 1]}`, title: channels[c - 1]});
        one.dataset.channel = c;
        return one;
      }));
    }));
  }

  // Add or remove a channel; the last one stays.
  toggle(channel) {
    const rest = this.channels.filter((c) => c !== channel);
    if (rest.length === this.channels.length) rest.push(channel);
    if (rest.length && rest.length <= MOST_CHANNELS) this.choose(rest);
  }

  choose(channels) {
    this.take(channels);
    this.onChoose();
  }

  take(channels) {
    this.channels = channels.slice(0, MOST_CHANNELS).sort((a, b) => a - b);
    this.kept.set(this.name, this.channels);
    for (const one of this.root.querySelectorAll('[data-channel]')) {
      const chosen = this.channels.includes(Number(one.dataset.channel));
      one.ariaPressed = String(chosen);
      one.disabled = !chosen && this.channels.length === MOST_CHANNELS;
    }
  }
}
