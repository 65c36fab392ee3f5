'use strict';
// Decodes the data that page_data.py encodes, merges bins for coarser views, and selects what to draw
// for an interval of time.

const NO_SAMPLE = 0xffff;

async function inflate(base64) {
  const text = atob(base64.trim());
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

class Reader {
  constructor(bytes) {
    this.bytes = bytes;
    this.at = 0;
  }

  bytesOf(n) {
    this.at += n;
    return this.bytes.subarray(this.at - n, this.at);
  }

  // 16-bit numbers: all low bytes, then all high ones.
  codes(n) {
    const low = this.bytesOf(n), high = this.bytesOf(n), codes = new Uint16Array(n);
    for (let i = 0; i < n; i++) codes[i] = low[i] | (high[i] << 8);
    return codes;
  }

  // The codes of each channel, summed up from the differences that were written.
  summed(channels, n) {
    const codes = this.codes(channels * n);
    for (let c = 0, i = 0; c < channels; c++) {
      for (let j = 0, sum = 0; j < n; j++, i++) {
        sum += (codes[i] >> 1) ^ -(codes[i] & 1);
        codes[i] = sum;
      }
    }
    return codes;
  }

  // Starts and stops, alternately, from their differences as 64-bit numbers.
  intervals(n) {
    const rows = new Float64Array(2 * n);
    for (let plane = 0, factor = 1; plane < 8; plane++, factor *= 256) {
      const bytes = this.bytesOf(2 * n);
      for (let i = 0; i < 2 * n; i++) rows[i] += factor * bytes[i];
    }
    for (let i = 1; i < 2 * n; i++) rows[i] += rows[i - 1];
    return rows;
  }
}

function decode(header, bytes) {
  const reader = new Reader(bytes), channels = header.channels.length, n = header.bins;
  const low = reader.summed(channels, n), span = reader.codes(channels * n);
  const high = low.map((code, i) => code + span[i]);
  const truth = header.truth === null ? null : reader.intervals(header.truth);
  const variants = header.variants.map((variant) => ({
    signals: each(variant.signals, () => (
      halved(reader.bytesOf(channels * n), channels, n, (a, b) => (a > b ? a : b)))),
    slip: reader.intervals(variant.slip),
    groups: variant.groups.map((group) => reader.intervals(group.intervals)),
    afterImpact: reader.intervals(variant.after_impact),
    snippets: variant.snippets.map(([start, rows]) => ({
      start, rows, volts: reader.summed(channels, rows),
      signals: each(variant.signals, () => reader.bytesOf(channels * rows)),
    })),
  }));
  return {
    truth,
    variants,
    // A bin without samples has the code NO_SAMPLE, the highest one, in both.
    low: halved(low, channels, n, (a, b) => (a < b ? a : b)),
    high: halved(high, channels, n, (a, b) => (a === NO_SAMPLE ? b : b === NO_SAMPLE || a > b ? a : b)),
  };
}

// An object with of(name) for each name, in the order of the names.
function each(names, of) {
  return Object.fromEntries(names.map((name) => [name, of(name)]));
}

// The values in all resolutions: as they are, then joined in twos, in fours and so on; in each the
// channels follow one another.
function halved(values, channels, n, join) {
  const sizes = [{values, n}];
  while (n > 512) {
    const half = Math.ceil(n / 2), next = new values.constructor(channels * half);
    for (let c = 0; c < channels; c++) {
      for (let j = 0; j < half; j++) {
        const i = c * n + 2 * j, last = 2 * j + 1 === n;
        next[c * half + j] = join(values[i], values[last ? i : i + 1]);
      }
    }
    sizes.push({values: next, n: half});
    values = next;
    n = half;
  }
  return sizes;
}

// The pieces to draw between two rows: single rows where they were kept, else bins of about a pixel.
// A piece: {row, rows, n, first, stop, low, high, signals}. Its value i begins at row + i * rows and
// spans that number of rows; the values from first up to stop are drawn. low, high and each of
// signals have n values for each channel; those of a channel begin at channel * n.
function pieces(header, data, variant, from, to, rowsOfPixel) {
  const level = Math.max(0, Math.ceil(Math.log2(rowsOfPixel / header.bin_rows)));
  const size = Math.min(level, data.low.length - 1), rows = header.bin_rows * 2 ** size;
  const {signals, snippets} = data.variants[variant], found = [], names = Object.keys(signals);
  // One more value at either end, so that curves reach the edge.
  [from, to] = [from - rows, to + rows];
  const bins = (start, stop) => {
    const {values: low, n} = data.low[size];
    const first = Math.max(0, Math.floor(start / rows)), end = Math.min(n, Math.ceil(stop / rows));
    if (end > first) {
      found.push({row: 0, rows, n, first, stop: end, low, high: data.high[size].values,
        signals: each(names, (name) => signals[name][size].values)});
    }
  };
  let at = from;
  if (rows > 1 && size === 0) {
    for (const {start, rows: n, volts, signals: codes} of snippets) {
      const stop = start + n;
      if (stop <= from || start >= to) continue;
      if (start > at) bins(at, start);
      found.push({
        row: start, rows: 1, n, first: Math.max(0, Math.floor(from) - start - 1),
        stop: Math.min(n, Math.ceil(to) - start + 1), low: volts, high: volts, signals: codes,
      });
      at = stop;
    }
  }
  if (at < to) bins(at, to);
  return found;
}

// The rows at which the values of pieces begin, and the row after the last value.
function startsOf(found) {
  const starts = [];
  let end = 0;
  for (const {row, rows, first, stop} of found) {
    // A bin that begins before its piece is drawn from the beginning of the piece on.
    for (let i = first; i < stop; i++) starts.push(Math.max(row + i * rows, end));
    end = row + stop * rows;
  }
  return [...starts, end];
}

// A channel's curve from pieces. choose(piece): the arrays of its lowest and highest values.
// code(value): the value to draw, or null where there is no sample.
function curveOf(found, channel, choose, code) {
  const rows = [], low = [], high = [];
  for (const piece of found) {
    const [lowest, highest] = choose(piece);
    for (let i = piece.first, k = channel * piece.n + i; i < piece.stop; i++, k++) {
      const from = code(lowest[k]), to = code(highest[k]), single = piece.rows === 1;
      rows.push(single ? from : null);
      low.push(single ? null : from);
      high.push(single ? null : to);
    }
  }
  // Repeated at its end, the last bin is drawn in its full length.
  for (const values of [low, high]) values.push(values.at(-1) ?? null);
  rows.push(null);
  return {rows, low, high};
}
