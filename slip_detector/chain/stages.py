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

The last stage is the decision: the windowed mean is compared with the threshold, or
:mod:`.evidence` is.
"""

from typing import NamedTuple

import numpy as np

from slip_detector.chain import layout
from slip_detector.chain.samples import Floats
from slip_detector.compiled import compiled_in_place, compiled_within
from slip_detector.vectors import (
    absolute,
    is_number,
    load,
    select,
    spread,
    square_root,
    store,
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
def window_sum(u, position, head, window, tile, tail):
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
        position, head, total = window_sum(u, position, head, window, tile, slot + 2)
        mean = square_root(total * per) if take_root else total * per
        store(mean, block, (k, 0))
        keep(mean, signal, out, start + k, at)
    tile[slot, 0] = position
    store(head, tile, (slot + 1, 0))


@compiled_in_place
def rows_above(block, rows, threshold, words, at):
    """Write the rows whose value is above the threshold to the words from column ``at`` on."""
    above, row = spread(NO_ROW), spread(FIRST_ROW)
    for k in range(rows):
        above = above | select(load(block, (k, 0)) > threshold, row, NO_ROW)
        row = row + row
    store(above, words, (ON, at))
