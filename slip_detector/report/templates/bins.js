// The bins of a report's recordings: decoded from what page.py has encoded, joined, chosen.

// The code of a bin without samples, the highest one.
const NO_SAMPLE = 0xffff;

const higherVolts = (a, b) => (a === NO_SAMPLE ? b : b === NO_SAMPLE || a > b ? a : b);

// The lowest and the highest volts, and the codes of levels of each variant, in all resolutions.
function decode({channels: {length: channels}, bins, bin_rows: binRows, variants}, bytes) {
  let at = 0;
  const next = (n) => bytes.subarray(at, at += n);
  const voltsOfBins = () => {
    const low = next(channels * bins), high = next(channels * bins);
    return new Uint16Array(low).map((code, i) => code | (high[i] << 8));
  };
  const low = voltsOfBins(), high = binRows > 1 ? voltsOfBins() : low;
  return {
    low: halved(low, channels, bins, Math.min),
    high: halved(high, channels, bins, higherVolts),
    variants: variants.map(() => halved(next(channels * bins), channels, bins, Math.max)),
  };
}

// Values as they are, then joined in twos, in fours and so on; the channels follow one another.
function halved(values, channels, n, join) {
  if (n <= 512) return [{values, n}];
  const half = Math.ceil(n / 2), next = new values.constructor(channels * half).map((_, k) => {
    const c = Math.floor(k / half), i = c * n + 2 * (k - c * half);
    return join(values[i], values[Math.min(i + 1, c * n + n - 1)]);
  });
  return [{values, n}, ...halved(next, channels, half, join)];
}

// What to draw between two rows, in bins of about a pixel: bins from first up to stop, of so many
// rows each; of low, high and codes, the n values of a channel begin at channel * n.
function binsBetween(from, to, {low, high, variants}, variant, binRows, rowsOfPixel) {
  const level = Math.max(0, Math.ceil(Math.log2(rowsOfPixel / binRows)));
  const size = Math.min(level, low.length - 1), rows = binRows * 2 ** size, {n} = low[size];
  // One more at either end, so that curves reach the edge.
  const first = Math.max(0, Math.floor(from / rows) - 1);
  const stop = Math.max(first, Math.min(n, Math.ceil(to / rows) + 1));
  const [lows, highs, codes] = [low, high, variants[variant]].map((each) => each[size].values);
  return {rows, n, first, stop, low: lows, high: highs, codes};
}
