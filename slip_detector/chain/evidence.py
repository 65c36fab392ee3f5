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

"""The decision by evidence: compares each channel with its own noise, sixteen side by side.

The *excess* of a channel is how far its envelope is above its noise floor, in dB. Evidence is the
integral over time of the excess less an offset: it grows during slip and falls otherwise (a
CUSUM). docs/method.md has the equations.

An invalid channel keeps its floor and its evidence. During an impact and its hold time the excess
of all channels is 0.
"""

import numpy as np

from slip_detector.chain.compiled import compiled_in_place
from slip_detector.chain.lanes import LANES, absolute, is_number, load, select, spread, store
from slip_detector.chain.logarithms import root_decibels
from slip_detector.chain.stages import (
    AGE,
    EVIDENCE,
    FIRST_ROW,
    FLOOR,
    HELD_EVIDENCE,
    HIGH,
    HOLD_ROWS,
    LAST,
    LOW,
    NO_ROW,
    count_up,
    keep,
)
from slip_detector.chain.votes import rows_of_count

#: Share of the time at rest during which a channel's envelope is below its floor.
QUANTILE = 0.1

#: Lower limit of the excess: less is a pause between two slips, not noise.
LEAST_EXCESS_DB = -8.7


@compiled_in_place
def _find_steps(volts, start, rows, column, tile_range, impact_v, tile, steps, seat):
    """Write the rows in which a channel steps by more than ``impact_v`` as words, by seat.

    A step counts from the last good sample, as the filters get that in place of a bad one.
    """
    low, high = load(tile_range, (LOW, 0)), load(tile_range, (HIGH, 0))
    last, found, row = load(tile, (LAST, 0)), spread(NO_ROW), spread(FIRST_ROW)
    for k in range(start, start + rows):
        sample = load(volts, (k, column))
        good = (sample >= low) & (sample <= high)
        found = found | select(good & (absolute(sample - last) > impact_v), row, NO_ROW)
        last = select(good, sample, last)
        row = row + row
    store(found, steps, seat)


@compiled_in_place
def rows_of_impact(volts, start, rows, settings, ranges, layout, tiles, steps, digits):
    """Return the rows within the hold time of an impact, as a word.

    The state keeps the number of rows that remain of the hold time. Call this before
    ``check_samples``, which replaces the last good samples before the first row.

    Parameters
    ----------
    volts, start, rows
        The samples, the first row and the number of rows.
    settings, ranges, layout
        Parts of the plan.
    tiles
        The state.
    steps, digits
        Working memory: a word per seat, and the digits for counting channels.
    """
    for t in range(layout.bases.size):
        _find_steps(
            volts, start, rows, layout.bases[t], ranges[t], settings.impact_v, tiles[t], steps,
            t * LANES,
        )  # fmt: skip
    impacts = rows_of_count(int(settings.impact_channels), layout.seats, steps, steps, digits)
    left = min(int(tiles[0, HOLD_ROWS, 0]), int(settings.hold_rows))
    if impacts == NO_ROW and left == 0:
        return NO_ROW
    held, row = NO_ROW, FIRST_ROW
    for _ in range(rows):
        if impacts & row:
            left = int(settings.hold_rows)
        if left > 0:
            held |= row
            left -= 1
        row = row << FIRST_ROW
    tiles[0, HOLD_ROWS, 0] = left
    return held


@compiled_in_place
def gains_of_evidence(
    block, rows, settings, least_db, settle_rows, valid, held, tile, signals, start, floor_column,
    excess_column,
):  # fmt: skip
    """Replace squares of the envelope by each row's gain of evidence, and track the noise floor.

    Parameters
    ----------
    block, rows
        Squares of the envelope, and the number of rows.
    settings
        Settings of the plan.
    least_db
        Lower limit of each channel's floor.
    settle_rows
        Number of rows, from a channel's first valid one, before its envelope counts.
    valid
        Words: the rows in which each channel is valid.
    held
        Word: the rows within the hold time of an impact.
    tile
        The state. A floor that is NaN begins with the envelope.
    signals, start, floor_column, excess_column
        Output of floor and excess; a negative column means that it is not wanted.
    """
    most_db = least_db + settings.floor_range_db
    up_db, down_db = spread(settings.floor_up_db), spread(-settings.floor_down_db)
    age, floor = load(tile, (AGE, 0)), load(tile, (FLOOR, 0))
    not_held, row = valid & ~held, spread(FIRST_ROW)
    for k in range(rows):
        level = root_decibels(load(block, (k, 0)))
        age = count_up(age, valid, row)
        counts = ((valid & row) != NO_ROW) & (age > settle_rows)
        moved = floor + select(level > floor, up_db, down_db)
        moved = select(is_number(floor), moved, level)
        moved = select(moved > least_db, moved, least_db)
        moved = select(moved < most_db, moved, most_db)
        floor = select(counts, moved, floor)
        excess = level - floor
        excess = select(excess > LEAST_EXCESS_DB, excess, LEAST_EXCESS_DB)
        excess = select(excess < settings.cap_db, excess, settings.cap_db)
        excess = select(counts & ((not_held & row) != NO_ROW), excess, 0.0)
        if floor_column >= 0:
            shown = select(is_number(floor), floor, least_db)
            store(shown, signals, (start + k, floor_column))
        if excess_column >= 0:
            store(excess, signals, (start + k, excess_column))
        gain = (excess - settings.offset_db) * settings.period_s
        store(select(counts, gain, 0.0), block, (k, 0))
        row = row + row
    store(age, tile, (AGE, 0))
    store(floor, tile, (FLOOR, 0))


@compiled_in_place
def sum_evidence(block, rows, limit, tile, signals, start, column, past_caches):
    """Replace each row's gain of evidence by the evidence, from 0 to ``limit``.

    It is also written to ``column`` of the signals, unless that is negative.
    """
    evidence = load(tile, (EVIDENCE, 0))
    for k in range(rows):
        evidence = evidence + load(block, (k, 0))
        evidence = select(evidence > 0.0, evidence, 0.0)
        evidence = select(evidence < limit, evidence, limit)
        store(evidence, block, (k, 0))
        if column >= 0:
            keep(evidence, signals, (start + k, column), past_caches)
    store(evidence, tile, (EVIDENCE, 0))


@compiled_in_place
def hold_evidence(block, rows, tile):
    """Replace evidence by the number that is above a threshold exactly where the channel is ON.

    A channel comes ON when its evidence exceeds the threshold, and goes OFF when twice its
    evidence does not. One number decides this for any threshold: the number of the row before, but
    at least the evidence and at most twice the evidence.
    """
    held = load(tile, (HELD_EVIDENCE, 0))
    for k in range(rows):
        evidence = load(block, (k, 0))
        most = evidence + evidence
        held = select(held < most, held, most)
        held = select(held > evidence, held, evidence)
        store(held, block, (k, 0))
    store(held, tile, (HELD_EVIDENCE, 0))


def floor_steps_db(rate_db_s: float, sample_rate_hz: float) -> tuple[float, float]:
    """Return by how much one row moves a noise floor up or down, in dB.

    The floor settles where both balance: with a share ``QUANTILE`` of the rows below it.

    Parameters
    ----------
    rate_db_s
        How fast the floor moves up.
    sample_rate_hz
        Rows per second.

    Examples
    --------
    >>> up_db, down_db = floor_steps_db(rate_db_s=0.5, sample_rate_hz=100.0)
    >>> round(up_db, 6), round(down_db, 6)
    (0.005, 0.045)
    """
    up_db = rate_db_s / sample_rate_hz
    return up_db, up_db * (1.0 - QUANTILE) / QUANTILE


def least_floor_db(noise_floor: float) -> float:
    """Return a noise floor in dB of the envelope's unit.

    Examples
    --------
    >>> least_floor_db(0.01)
    -40.0
    """
    return 20.0 * float(np.log10(noise_floor))
