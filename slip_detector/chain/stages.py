# Copyright 2026 The slip_detector maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The stages of the chain on one tile: sixteen channels side by side, some rows at a time.

Each function takes a tile's state, an array of shape (slots, 16) with one value per lane in each
slot, and ``block``, shape (rows, 16), whose rows each stage replaces in place. Decisions about
rows are words, one per lane, with one bit per row; the lowest bit is the first row.

The result of a row does not depend on its position in a block.
"""

import numpy as np

from slip_detector.chain.compiled import compiled_in_place
from slip_detector.chain.lanes import (
    absolute,
    is_number,
    load,
    select,
    spread,
    square_root,
    store,
    store_past_caches,
)

#: Number of rows in a word.
WORD_ROWS = 64

NO_ROW, FIRST_ROW = np.uint64(0), np.uint64(1)

# The first slots of a tile's state; the slots of the sections, the comb and the windows follow.
# Five have one number for the whole tile, in lane 0:
# - ENVELOPE_ROW, LEVEL_ROW: rows so far in the current stretch of a window
# - COMB_ROW: rows so far in the current period of the comb
# - COMMON_V, in the first tile only: common mode of the last row
# - HOLD_ROWS, in the first tile only: remaining rows of the hold time of an impact
# The slots from COMB_ROW on are for comb and evidence.
(
    LAST,
    REPEATS,
    FIRST,
    HELD,
    ENVELOPE_HEAD,
    LEVEL_HEAD,
    ENVELOPE_ROW,
    LEVEL_ROW,
    COMMON_V,
    COMB_ROW,
    COMB_AGE,
    AGE,
    FLOOR,
    EVIDENCE,
    HELD_EVIDENCE,
    HOLD_ROWS,
    FIXED_SLOTS,
) = range(17)

# Rows of a tile's range: the lowest and the highest good sample of each channel.
LOW, HIGH = 0, 1


@compiled_in_place
def check_samples(volts, start, rows, column, tile_range, flat_rows, tile, words, at):
    """Write the rows with a good sample that is not flat to ``words`` from ``at`` on.

    ``column`` is the first of the tile's columns in ``volts``. The state keeps each channel's last
    good sample and how many times it has been repeated.
    """
    low, high = load(tile_range, (LOW, 0)), load(tile_range, (HIGH, 0))
    last, repeats = load(tile, (LAST, 0)), load(tile, (REPEATS, 0))
    valid, row = spread(NO_ROW), spread(FIRST_ROW)
    for k in range(start, start + rows):
        sample = load(volts, (k, column))
        good = (sample >= low) & (sample <= high)  # false for NaN too
        repeats = select(good, select(sample == last, repeats + 1.0, 0.0), repeats)
        last = select(good, sample, last)
        valid = valid | select(good & (repeats < flat_rows), row, NO_ROW)
        row = row + row
    store(last, tile, (LAST, 0))
    store(repeats, tile, (REPEATS, 0))
    store(valid, words, at)


@compiled_in_place
def load_deviations(volts, start, rows, column, tile_range, common_v, tile, block):
    """Write the filters' input to ``block``: deviations from each channel's first good sample.

    The network has no gain at 0 Hz. Therefore filtering the deviation from rest gives the same as
    filtering the samples from the steady state of the first one, without the rounding errors of a
    large constant. A bad sample is replaced by the input of the row before.
    """
    low, high = load(tile_range, (LOW, 0)), load(tile_range, (HIGH, 0))
    first, held = load(tile, (FIRST, 0)), load(tile, (HELD, 0))
    for k in range(rows):
        sample = load(volts, (start + k, column))
        good = (sample >= low) & (sample <= high)
        first = select(good, select(is_number(first), first, sample), first)
        held = select(good, (sample - first) - common_v[k], held)
        store(held, block, (k, 0))
    store(first, tile, (FIRST, 0))
    store(held, tile, (HELD, 0))


@compiled_in_place
def count_up(age, valid, row):
    """Return the number of rows from each channel's first valid row on; 0 before that row."""
    return select(((valid & row) != NO_ROW) | (age > 0.0), age + 1.0, age)


@compiled_in_place
def take_off_mains(block, rows, comb_rows, valid, tile, tail):
    """Subtract from each row the row ``comb_rows`` earlier, which is whole mains periods earlier.

    The result is 0 for the first ``comb_rows`` rows from a channel's first valid row on. ``valid``
    has the valid rows of each channel, as words, and ``tail`` is the first slot of earlier rows.
    """
    position, age, row = int(tile[COMB_ROW, 0]), load(tile, (COMB_AGE, 0)), spread(FIRST_ROW)
    for k in range(rows):
        u, before = load(block, (k, 0)), load(tile, (tail + position, 0))
        store(u, tile, (tail + position, 0))
        age = count_up(age, valid, row)
        store(select(age > float(comb_rows), u - before, 0.0), block, (k, 0))
        row = row + row
        position += 1
        if position == comb_rows:
            position = 0
    tile[COMB_ROW, 0] = position
    store(age, tile, (COMB_AGE, 0))


@compiled_in_place
def _coefficients(sections, s):
    return sections[s, 0], sections[s, 1], sections[s, 2], sections[s, 4], sections[s, 5]


@compiled_in_place
def _delays(tile, s):
    at = FIXED_SLOTS + 2 * s
    return load(tile, (at, 0)), load(tile, (at + 1, 0))


@compiled_in_place
def _store_delays(delays, tile, s):
    at = FIXED_SLOTS + 2 * s
    store(delays[0], tile, (at, 0))
    store(delays[1], tile, (at + 1, 0))


@compiled_in_place
def _section(u, coefficients, delays):
    """Return the output of a second-order section (transposed direct form II), and its delays."""
    b0, b1, b2, a1, a2 = coefficients
    y = b0 * u + delays[0]
    return y, ((b1 * u + delays[1]) - a1 * y, b2 * u - a2 * y)


@compiled_in_place
def run_filters(block, rows, sections, tile):
    """Run rows through the second-order sections, in place.

    Each pass runs two sections, whose coefficients and delays fit into the registers.
    """
    n = sections.shape[0]
    for s in range(0, n - 1, 2):
        first, second = _coefficients(sections, s), _coefficients(sections, s + 1)
        of_first, of_second = _delays(tile, s), _delays(tile, s + 1)
        for k in range(rows):
            u, of_first = _section(load(block, (k, 0)), first, of_first)
            u, of_second = _section(u, second, of_second)
            store(u, block, (k, 0))
        _store_delays(of_first, tile, s)
        _store_delays(of_second, tile, s + 1)
    if n % 2 == 1:
        last, of_last = _coefficients(sections, n - 1), _delays(tile, n - 1)
        for k in range(rows):
            u, of_last = _section(load(block, (k, 0)), last, of_last)
            store(u, block, (k, 0))
        _store_delays(of_last, tile, n - 1)


@compiled_in_place
def rectified_power(block, rows, full_wave, exponent):
    """Rectify (Eq. 3) and raise to the exponent (Eq. 5), then square for the RMS (Eq. 6)."""
    for k in range(rows):
        u = load(block, (k, 0))
        u = absolute(u) if full_wave else select(u > 0.0, u, 0.0)
        power = u
        if exponent == 3:  # faster for the paper's exponent
            power = u * u * u
        else:
            for _ in range(exponent - 1):
                power = power * u
        store(power * power, block, (k, 0))


@compiled_in_place
def keep(values, signals, at, past_caches):
    """Write the values of a tile's row to the result.

    ``past_caches`` requires a place at which a cache line begins, and pays for large results.
    """
    if past_caches:
        store_past_caches(values, signals, at)
    else:
        store(values, signals, at)


@compiled_in_place
def window_means(
    block, rows, window, tile, row_slot, head_slot, tail, take_root, signals, start, column,
    past_caches,
):  # fmt: skip
    """Replace each value by the mean of the last ``window`` values, zeros before the first row.

    Time is cut into stretches of ``window`` rows. A window is the head of the current stretch plus
    the tail of the previous one; the sums of all tails are computed once, when a stretch ends.
    Terms are added and never subtracted, so a huge value leaves no error behind. ``tail`` is the
    slot of the first tail. With ``take_root`` the result is the root of the mean.

    The means are also written to ``column`` of the signals, unless that is negative. Each is
    written at once, so that it reaches memory while the next one is computed.
    """
    position, head, per = int(tile[row_slot, 0]), load(tile, (head_slot, 0)), 1.0 / window
    for k in range(rows):
        u = load(block, (k, 0))
        head = head + u
        store(u, tile, (tail + position, 0))
        mean = (head + load(tile, (tail + position + 1, 0))) * per
        mean = square_root(mean) if take_root else mean
        store(mean, block, (k, 0))
        if column >= 0:
            keep(mean, signals, (start + k, column), past_caches)
        position += 1
        if position == window:
            position, head, total = 0, spread(0.0), spread(0.0)
            for j in range(tail + window - 1, tail - 1, -1):
                total = load(tile, (j, 0)) + total
                store(total, tile, (j, 0))
    tile[row_slot, 0] = position
    store(head, tile, (head_slot, 0))


@compiled_in_place
def keep_roots(block, rows, signals, start, column):
    """Write the square roots of a tile's values to the signals, from ``column`` on."""
    for k in range(rows):
        store(square_root(load(block, (k, 0))), signals, (start + k, column))


@compiled_in_place
def rows_above(block, rows, threshold, words, at):
    """Write the rows whose value is above the threshold to ``words`` from ``at`` on."""
    above, row = spread(NO_ROW), spread(FIRST_ROW)
    for k in range(rows):
        above = above | select(load(block, (k, 0)) > threshold, row, NO_ROW)
        row = row + row
    store(above, words, at)
