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

"""Evidence, the decision that compares each channel with its own noise, on one tile.

The *excess* of a channel is how far its envelope is above its noise floor, in dB. Evidence is the
integral over time of the excess less an offset: it grows during slip and falls otherwise (a
CUSUM). docs/method.md has the equations; tiles, blocks and words are those of :mod:`.stages`.
"""

import numpy as np

from slip_detector.chain import layout, stages
from slip_detector.chain.decibels import (
    NEARLY_LOG2,
    exponents,
    fractions,
    polynomial,
    root_decibels,
)
from slip_detector.chain.stages import FIRST_ROW, NO_ROW, keep, window_sum
from slip_detector.compiled import compiled_within
from slip_detector.vectors import LANES, is_number, load, select, spread, square_root, store

#: Share of the time at rest during which a channel's envelope is below its floor.
QUANTILE = 0.1

#: Power at which contact goes on, as a share of the power at which it begins: 2 dB less.
CONTACT_GOES_ON = 10.0**-0.2

#: Lower limit of the excess: a lower one is a pause between two slips, not noise.
LEAST_EXCESS_DB = -8.7


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
        position, head, total = window_sum(z * z, position, head, window, tile, slot + 6)
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
    store(begins, words, (stages.TOUCHES, at))
    store(goes_on, words, (stages.GOES_ON, at))


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
    settings, limits, valid = (
        plan.settings[0],
        plan.limits[at // LANES],
        load(words, (stages.VALID, at)),
    )
    moves = valid if settings.free_floors == 0 else load(words, (stages.MOVES, at))
    settle_rows = float(settings.mains_rows + settings.envelope_rows)
    least_db, lift_db = load(limits, (stages.LEAST_DB, 0)), settings.activity_cap_db
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
        keep(square_root(square), stages.ENVELOPE, out, start + k, at)
        signal_db = select(is_number(floor), select(counts, effective, floor), least_db)
        keep(signal_db, stages.EFFECTIVE, out, start + k, at)
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
        keep(evidence, stages.LEVEL, out, start + k, at)
        keep(excess, stages.EXCESS, out, start + k, at)
    store(evidence, tile, (layout.EVIDENCE, 0))
    store(number, tile, (layout.HELD_EVIDENCE, 0))


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
