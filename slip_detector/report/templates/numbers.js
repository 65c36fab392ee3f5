'use strict';
// Functions of numbers alone: the report and the live page load this script first.

const clamp = (value, least, most) => Math.min(Math.max(value, least), most);

// A value with three significant digits, as it is set and read.
const rounded = (value) => Number(value.toPrecision(3));

function volts(value) {
  const size = Math.abs(value);
  if (size && (size < 1e-3 || size >= 1e5)) return `${value.toExponential(2)} V`;
  if (size < 0.1) return `${(1e3 * value).toPrecision(3)} mV`;
  return `${value.toPrecision(size >= 1000 ? 6 : 4)} V`;
}

const voltsBetween = (low, high) => (high > low ? `${volts(low)} to ${volts(high)}` : volts(low));

// The time of a clock in UTC with so many digits after the point: hh:mm:ss.
function timeText(seconds, digits) {
  const text = new Date(Math.round(1000 * seconds)).toISOString();
  return text.slice(11, digits ? 20 + digits : 19);
}

// The lowest and the highest of values; null where there is none.
function rangeOf(values) {
  let least = Infinity, most = -Infinity;
  for (const value of values) {
    if (value == null) continue;
    if (value < least) least = value;
    if (value > most) most = value;
  }
  return least <= most ? [least, most] : null;
}

// A range that grows at once, with a margin, but shrinks only when less than a share is wanted.
function steady(before, [least, most], share, margin = 0) {
  const size = most - least;
  const holdsAll = before && least >= before[0] && most <= before[1];
  if (holdsAll && size > share * (before[1] - before[0])) return before;
  return [least - margin * size, most + margin * size];
}

// Seconds from tick to tick: 1, 2 and 5 times powers of ten below a second, then those of a clock.
const TICKS_S = [
  ...[1e-4, 1e-3, 1e-2, 1e-1].flatMap((power) => [power, 2 * power, 5 * power]),
  1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 36000, 86400, 864000,
];

// The ticks of an axis, so many seconds apart at least, and the digits that tell them apart.
function ticksBetween(from, to, least_s) {
  const times = [], step = TICKS_S.find((s) => s >= least_s) ?? TICKS_S.at(-1);
  const digits = step >= 1 ? 0 : Math.min(3, Math.ceil(-Math.log10(step) - 1e-9));
  for (let n = Math.ceil(from / step); n * step <= to; n++) times.push(n * step);
  return {times, digits};
}
