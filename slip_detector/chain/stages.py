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

"""The stages of the chain on one tile, in the order in which a sample meets them.

A tile is sixteen channels side by side. Each function takes a tile's state, an array of shape
(slots, 16) with one value per lane in each slot, and ``block``, shape (rows, 16), whose rows each
stage replaces in place. Decisions about rows are words, one per lane, with one bit per row; the
lowest bit is the first row. The result of a row does not depend on its position in a block.

The last stage is the decision: the windowed mean is compared with the threshold, or *evidence*
is. The *excess* of a channel is how far its envelope is above its noise floor, in dB. Evidence is
the integral over time of the excess less an offset: it grows during slip and falls otherwise (a
CUSUM). docs/method.md has the equations.
"""

from typing import NamedTuple

import numpy as np

from slip_detector.chain import layout
from slip_detector.chain.samples import Floats
from slip_detector.compiled import compiled_in_place, compiled_within
from slip_detector.vectors import (
    LANES,
    absolute,
    floats_of,
    is_number,
    load,
    select,
    spread,
    square_root,
    store,
    words_of,
)

#: Number of rows in a word.
WORD_ROWS = 64

NO_ROW, FIRST_ROW = np.uint64(0), np.uint64(1)

# Rows of a tile's limits: the lowest and highest good sample, and the least noise floor in dB.
LOW, HIGH, LEAST_DB = range(3)

# The words of each channel: the rows in which the channel is valid, steps as in an impact, differs
# from its last good sample, is ON, has a low level above the level of contact, and one above that
# level less 2 dB.
VALID, STEPS, MOVES, ON, TOUCHES, GOES_ON = range(6)

# The signals in their order. The floor among them is the effective one, lifted by activity.
ENVELOPE, LEVEL, EFFECTIVE, EXCESS = range(4)

#: Share of the time at rest during which a channel's envelope is below its floor.
QUANTILE = 0.1

#: Power at which contact goes on, as a share of the power at which it begins: 2 dB less.
CONTACT_GOES_ON = 10.0**-0.2

#: Lower limit of the excess: a lower one is a pause between two slips, not noise.
LEAST_EXCESS_DB = -8.7


@compiled_within
def check_samples(volts, start, end, at, limits, settings, tile, words):
    """Find the rows with a good sample that is not flat, with a step of an impact, that move.

    A step is the difference from the last good sample, or from the one ``impact_rows`` rows ago.
    ``at`` is the first column of the tile.
    """
    low, high = load(limits, (LOW, 0)), load(limits, (HIGH, 0))
    last, repeats = load(tile, (layout.LAST, 0)), load(tile, (layout.REPEATS, 0))
    flat_rows, impact_v, delay = settings.flat_rows, settings.impact_v, settings.impact_rows
    slot = settings.steps_slot
    position = int(tile[slot, 0]) if delay > 0 else 0
    for begin in range(start, end, WORD_ROWS):
        valid, stepped, moves = spread(NO_ROW), spread(NO_ROW), spread(NO_ROW)
        row = spread(FIRST_ROW)
        for k in range(begin, min(begin + WORD_ROWS, end)):
            sample = load(volts, (k, at))
            good = (sample >= low) & (sample <= high)  # false for NaN too
            before = last
            if delay > 0:
                position += 1
                before = load(tile, (slot + position, 0))
            if impact_v > 0.0:
                step = absolute(sample - before)
                stepped = stepped | select(good & (step > impact_v), row, NO_ROW)
            if settings.free_floors != 0:
                other = (sample < last) | (sample > last)  # false for the first sample
                moves = moves | select(good & other, row, NO_ROW)
            repeats = select(good, select(sample == last, repeats + 1.0, 0.0), repeats)
            last = select(good, sample, last)
            if delay > 0:
                store(last, tile, (slot + position, 0))
                position = 0 if position == delay else position
            valid = valid | select(good & (repeats < flat_rows), row, NO_ROW)
            row = row + row
        w = (begin - start) // WORD_ROWS
        store(valid, words, (w, VALID, at))
        store(stepped, words, (w, STEPS, at))
        store(moves, words, (w, MOVES, at))
    store(last, tile, (layout.LAST, 0))
    store(repeats, tile, (layout.REPEATS, 0))
    if delay > 0:
        tile[slot, 0] = position


@compiled_within
def load_deviations(block, volts, start, rows, at, limits, tile, common_v):
    """Write the filters' input to the block: deviations from each channel's first good sample.

    The network has no gain at 0 Hz. Therefore deviations give the same as samples filtered from
    the steady state of the first one, without the rounding errors of a large constant. A bad
    sample is replaced by the input of the row before.
    """
    low, high = load(limits, (LOW, 0)), load(limits, (HIGH, 0))
    first, held = load(tile, (layout.FIRST, 0)), load(tile, (layout.HELD, 0))
    for k in range(rows):
        sample = load(volts, (start + k, at))
        good = (sample >= low) & (sample <= high)
        first = select(good, select(is_number(first), first, sample), first)
        held = select(good, (sample - first) - common_v[k], held)
        store(held, block, (k, 0))
    store(first, tile, (layout.FIRST, 0))
    store(held, tile, (layout.HELD, 0))


@compiled_in_place
def subtract_mains(block, rows, settings, tile):
    """Subtract from each row the row ``mains_rows`` earlier, which is whole mains periods earlier.

    The result is 0 for the first ``mains_rows`` rows from a channel's first good sample on: rows
    before it are NaN.
    """
    slot = settings.comb_slot
    position = int(tile[slot, 0])
    for k in range(rows):
        position += 1
        u = load(block, (k, 0))
        difference = u - load(tile, (slot + position, 0))
        store(u, tile, (slot + position, 0))
        store(select(is_number(difference), difference, 0.0), block, (k, 0))
        if position == settings.mains_rows:
            position = 0
    tile[slot, 0] = position


@compiled_in_place
def run_filters(block, rows, sections, tile, delay_slot):
    """Run rows through the second-order sections (transposed direct form II), in place."""
    for s in range(sections.shape[0]):
        b0, b1, b2 = sections[s, 0], sections[s, 1], sections[s, 2]
        a1, a2 = sections[s, 4], sections[s, 5]
        slot = delay_slot + 2 * s
        first, second = load(tile, (slot, 0)), load(tile, (slot + 1, 0))
        for k in range(rows):
            u = load(block, (k, 0))
            y = b0 * u + first
            first = (b1 * u + second) - a1 * y
            second = b2 * u - a2 * y
            store(y, block, (k, 0))
        store(first, tile, (slot, 0))
        store(second, tile, (slot + 1, 0))


@compiled_in_place
def rectified_power(block, rows, full_wave, exponent):
    """Rectify (Eq. 3) and raise to the exponent (Eq. 5), then square for the RMS (Eq. 6)."""
    for k in range(rows):
        u = load(block, (k, 0))
        u = absolute(u) if full_wave else select(u > 0.0, u, 0.0)
        power = u
        for _ in range(exponent - 1):
            power = power * u
        store(power * power, block, (k, 0))


@compiled_within
def _window_sum(u, position, head, window, tile, tail):
    """Return position and head after a value, and the sum of the last ``window`` values.

    Time is cut into stretches of ``window`` rows. A window is the head of the current stretch plus
    the tail of the previous one; the sums of all tails are computed once, when a stretch ends.
    Terms are added and never subtracted, so a huge value leaves no error behind. The state has the
    values of the current stretch and the tails from the slot ``tail`` on.
    """
    head = head + u
    store(u, tile, (tail + position, 0))
    total = head + load(tile, (tail + position + 1, 0))
    position += 1
    if position == window:
        position, head, tail_sum = 0, spread(0.0), spread(0.0)
        for j in range(tail + window - 1, tail - 1, -1):
            tail_sum = load(tile, (j, 0)) + tail_sum
            store(tail_sum, tile, (j, 0))
    return position, head, total


class Output(NamedTuple):
    """The signals of a result, which of them are wanted, and the first column of each."""

    signals: Floats
    wanted: tuple[bool, ...]
    columns: tuple[int, ...]


@compiled_within
def keep(values, signal, out, row, at):
    """Write a signal of a tile, whose first column is ``at``, if the signal is wanted."""
    if out.wanted[signal]:
        store(values, out.signals, (row, out.columns[signal] + at))


@compiled_in_place
def window_means(block, start, rows, at, window, tile, slot, take_root, signal, out):
    """Replace each value by the mean of the last ``window`` values, zeros before the first row.

    The state has the position within the stretch at ``slot``, then the head and the tails. With
    ``take_root`` the result is the root of the mean.

    The means are also written as a signal, each at once, so that it reaches memory while the next
    one is computed.
    """
    position, head, per = int(tile[slot, 0]), load(tile, (slot + 1, 0)), 1.0 / window
    for k in range(rows):
        u = load(block, (k, 0))
        position, head, total = _window_sum(u, position, head, window, tile, slot + 2)
        mean = square_root(total * per) if take_root else total * per
        store(mean, block, (k, 0))
        keep(mean, signal, out, start + k, at)
    tile[slot, 0] = position
    store(head, tile, (slot + 1, 0))


# Layout of a float64: mask and number of the fraction's bits, the bits of 1.0, and the bias of the
# exponent.
FRACTION, FRACTION_BITS, ONE = np.uint64(2**52 - 1), np.uint64(52), np.uint64(0x3FF << 52)
BIAS = 1023.0

# In the sum of 2^52 and a smaller integer, the bits of the fraction are that integer.
LARGE, LARGE_BITS = 2.0**52, np.uint64(0x433 << 52)

#: Decibels of the square root of 2: :func:`root_decibels` takes squares.
OCTAVE_DB = 10.0 * float(np.log10(2.0))

#: Coefficients of q in log2(1 + t) = t + t (1 - t) q(t), highest power first: the polynomial of
#: its degree with the least error for t within [0, 1]. The logarithm is exact at both ends, hence
#: continuous, and it rises everywhere.
BETWEEN_OCTAVES = (
    0.025841442564341566,
    -0.09595644602069042,
    0.18194887353480288,
    -0.2756003104344289,
    0.44254494337489514,
)

#: Coefficients of q in log2(1 + t) = t q(t), of a lower degree, for activity: 3.5e-4 dB of error.
NEARLY_LOG2 = (-0.0821307307268031, 0.3211890041214286, -0.6777840230453743, 1.4387257496507488)


@compiled_in_place
def exponents(values):
    """Return the exponents of float64, as float64."""
    return floats_of((words_of(values) >> FRACTION_BITS) | LARGE_BITS) - (LARGE + BIAS)


@compiled_in_place
def fractions(values):
    """Return the fractions of float64, from 1 to below 2."""
    return floats_of((words_of(values) & FRACTION) | ONE)


@compiled_in_place
def powers_of_2(exponent):
    """Return 2 to the power of integers from -1023 (which gives 0) to 1024 (infinity)."""
    return floats_of(words_of(exponent + (LARGE + BIAS)) << FRACTION_BITS)


@compiled_in_place
def polynomial(coefficients, x):
    """Return the value of a polynomial whose highest power comes first."""
    value = spread(coefficients[0])
    for coefficient in coefficients[1:]:
        value = value * x + coefficient
    return value


@compiled_in_place
def root_decibels(squares):
    """Return the square roots of non-negative numbers in decibels, with an error up to 7e-6 dB.

    A library's logarithms differ in their last bits from machine to machine; these do not, and
    take a fraction of the time. Below the least normal number the result falls linearly, at 0 to
    -3080 dB; it is never infinite or NaN.
    """
    t = fractions(squares) - 1.0
    return (exponents(squares) + (t + t * (1.0 - t) * polynomial(BETWEEN_OCTAVES, t))) * OCTAVE_DB


@compiled_within
def find_low_level(block, low, rows, sections, settings, tile, words, at):
    """Write the sum of squares within the low band, and the rows in which it is that of contact.

    One pass has filters, square and window, without the gain of the filters. Both sections have
    zeros at 0 Hz and half the rate, 1 - z^-2.
    """
    a1, a2, c1, c2 = sections[0, 4], sections[0, 5], sections[1, 4], sections[1, 5]
    slot = settings.low_slot
    f1, s1 = load(tile, (slot, 0)), load(tile, (slot + 1, 0))
    f2, s2 = load(tile, (slot + 2, 0)), load(tile, (slot + 3, 0))
    window, position = settings.envelope_rows, int(tile[slot + 4, 0])
    head = load(tile, (slot + 5, 0))
    begins, goes_on, row = spread(NO_ROW), spread(NO_ROW), spread(FIRST_ROW)
    begins_v2, goes_on_v2 = settings.contact_v2, settings.contact_v2 * CONTACT_GOES_ON
    gated, lifted = settings.contact_channels > 0, settings.activity_cap_db > 0.0
    factor, shift_db = settings.activity_factor, settings.activity_shift_db
    for k in range(rows):
        u = load(block, (k, 0))
        u = select(is_number(u), u, 0.0)
        y = u - f1
        f1 = s1 + a1 * y
        s1 = u + a2 * y
        z = y - f2
        f2 = s2 + c1 * z
        s2 = y + c2 * z
        position, head, total = _window_sum(z * z, position, head, window, tile, slot + 6)
        if lifted:
            t = fractions(total) - 1.0
            octaves = exponents(total) + t * polynomial(NEARLY_LOG2, t)
            store(octaves * factor + shift_db, low, (k, 0))
        if gated:
            begins = begins | select(total > begins_v2, row, NO_ROW)
            goes_on = goes_on | select(total > goes_on_v2, row, NO_ROW)
            row = row + row
    store(f1, tile, (slot, 0))
    store(s1, tile, (slot + 1, 0))
    store(f2, tile, (slot + 2, 0))
    store(s2, tile, (slot + 3, 0))
    tile[slot + 4, 0] = position
    store(head, tile, (slot + 5, 0))
    store(begins, words, (TOUCHES, at))
    store(goes_on, words, (GOES_ON, at))


@compiled_within
def find_excess(block, low, start, rows, at, plan, tile, words, contact, touch, out):
    """Replace squares of the envelope by its excess over the effective floor, in dB.

    A channel that does not count has NaN, and keeps its floor; so has one without a floor yet.
    Floors move in the rows of the word ``touch`` only; a floor that is NaN begins there with the
    envelope. If none are given, the least is NaN, and floors begin and move only in rows in which
    the channel's samples change and its envelope is above 0: a sensor that stands still for a
    moment is no level of noise. The effective floor follows ``low``, in dB, from the floor itself
    up to a cap above it. For the common excess, ``low`` becomes the excess over the floor itself,
    at least 0 (also without a floor), or infinity where a channel does not count.
    """
    settings, limits, valid = plan.settings[0], plan.limits[at // LANES], load(words, (VALID, at))
    moves = valid if settings.free_floors == 0 else load(words, (MOVES, at))
    settle_rows = float(settings.mains_rows + settings.envelope_rows)
    least_db, lift_db = load(limits, (LEAST_DB, 0)), settings.activity_cap_db
    most_db, is_given = least_db + settings.noise_floor_range_db, is_number(least_db)
    up_db, down_db = spread(settings.floor_up_db), spread(-settings.floor_down_db)
    age, floor, row = load(tile, (layout.AGE, 0)), load(tile, (layout.FLOOR, 0)), spread(FIRST_ROW)
    for k in range(rows):
        square = load(block, (k, 0))
        level = root_decibels(square)
        is_moving = ((moves & row) != NO_ROW) & (is_given | (square > 0.0))
        age = select(is_moving | (age > 0.0), age + 1.0, age)
        counts = ((valid & row) != NO_ROW) & (age > settle_rows)
        if touch & FIRST_ROW:
            moved = floor + select(level > floor, up_db, down_db)
            moved = select(is_number(floor), moved, level)
            moved = select(moved < least_db, least_db, moved)
            moved = select(moved > most_db, most_db, moved)
            floor = select(counts & is_moving, moved, floor)
        effective = floor
        if lift_db > 0.0 and contact & FIRST_ROW:
            lifted, most = load(low, (k, 0)), floor + lift_db
            lifted = select(lifted > floor, lifted, floor)
            effective = select(lifted < most, lifted, most)
        contact, touch = contact >> FIRST_ROW, touch >> FIRST_ROW
        store(select(counts, level - effective, np.nan), block, (k, 0))
        if settings.common_rank > 0:
            bare = level - floor
            store(select(counts, select(bare > 0.0, bare, 0.0), np.inf), low, (k, 0))
        keep(square_root(square), ENVELOPE, out, start + k, at)
        signal_db = select(is_number(floor), select(counts, effective, floor), least_db)
        keep(signal_db, EFFECTIVE, out, start + k, at)
        row = row + row
    store(age, tile, (layout.AGE, 0))
    store(floor, tile, (layout.FLOOR, 0))


@compiled_within
def sum_evidence(block, start, rows, at, plan, tile, held, contact, out):
    """Replace the excess by the number that makes a channel ON where it is above the threshold.

    A channel comes ON when its evidence exceeds the threshold, and goes OFF when twice its
    evidence does not. One number decides this for any threshold: the number of the row before, but
    at least the evidence and at most twice the evidence. The common excess is subtracted from all
    channels. A channel that does not count keeps its evidence. Out of contact, and in the rows
    after an impact, which the word ``held`` has, the excess of all channels is 0.
    """
    evidence, number = load(tile, (layout.EVIDENCE, 0)), load(tile, (layout.HELD_EVIDENCE, 0))
    settings, common_db = plan.settings[0], plan.common_db
    cap_db, limit_db_s = settings.evidence_cap_db, settings.evidence_limit_db_s
    summed = contact & ~held
    for k in range(rows):
        over = load(block, (k, 0)) - common_db[k]
        counts, excess = is_number(over), spread(0.0)
        if summed & FIRST_ROW:
            excess = select(over > LEAST_EXCESS_DB, over, LEAST_EXCESS_DB)
            excess = select(excess < cap_db, excess, cap_db)
            excess = select(counts, excess, 0.0)
        summed = summed >> FIRST_ROW
        gain = select(counts, (excess - settings.evidence_offset_db) * settings.period_s, 0.0)
        evidence = evidence + gain
        evidence = select(evidence > 0.0, evidence, 0.0)
        evidence = select(evidence < limit_db_s, evidence, limit_db_s)
        most = evidence + evidence
        number = select(number < most, number, most)
        number = select(number > evidence, number, evidence)
        store(number, block, (k, 0))
        keep(evidence, LEVEL, out, start + k, at)
        keep(excess, EXCESS, out, start + k, at)
    store(evidence, tile, (layout.EVIDENCE, 0))
    store(number, tile, (layout.HELD_EVIDENCE, 0))


@compiled_in_place
def rows_above(block, rows, threshold, words, at):
    """Write the rows whose value is above the threshold to the words from column ``at`` on."""
    above, row = spread(NO_ROW), spread(FIRST_ROW)
    for k in range(rows):
        above = above | select(load(block, (k, 0)) > threshold, row, NO_ROW)
        row = row + row
    store(above, words, (ON, at))


def floor_steps_db(rate_db_s: float, sample_rate_hz: float) -> tuple[float, float]:
    """Return by how much one row moves a noise floor up or down, in dB.

    The floor settles where both balance: with a share ``QUANTILE`` of the rows below it.

    Examples
    --------
    >>> up_db, down_db = floor_steps_db(rate_db_s=0.5, sample_rate_hz=100.0)
    >>> round(up_db, 6), round(down_db, 6)
    (0.005, 0.045)
    """
    up_db = rate_db_s / sample_rate_hz
    return up_db, up_db * (1.0 - QUANTILE) / QUANTILE
