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

"""The common mode: the mean or median of all valid channels of a row.

It is computed from deviations from each channel's first good sample. Of the samples themselves it
would jump whenever a channel has no good sample, as baselines differ by far more than the signal.
A channel that starts late is assumed to have followed the others until then.

A *seat* is a channel's place in the tiles: 16 x the index of its tile + its lane.
"""

import numpy as np

from slip_detector.chain.compiled import compiled, compiled_in_place
from slip_detector.chain.lanes import LANES, is_number, load, select, store
from slip_detector.chain.stages import COMMON_V, FIRST, FIRST_ROW, HIGH, LOW, NO_ROW, WORD_ROWS

#: The values of the parameter ``common_mode`` as numbers.
NO_COMMON_MODE, MEAN, MEDIAN = range(3)
COMMON_MODE_NUMBERS = {'none': NO_COMMON_MODE, 'mean': MEAN, 'median': MEDIAN}

#: Largest number of channels whose median is found by exchanges, sixteen rows side by side.
EXCHANGED_CHANNELS = 32


@compiled_in_place
def _all_valid(rows, seats, tiles, valid):
    """Return whether all channels have started and are valid in all rows."""
    whole = ~NO_ROW >> np.uint64(WORD_ROWS - rows)
    for seat in seats:
        if np.isnan(tiles[seat // LANES, FIRST, seat % LANES]) or valid[seat] != whole:
            return False
    return True


@compiled_in_place
def _medians(volts, start, rows, columns, seats, tiles, deviations, common_v):
    """Write the medians of rows in which all channels are valid.

    Sorting one row takes an unpredictable branch for each pair; exchanging values in sixteen rows
    at once takes none.
    """
    channels = seats.size
    for i in range(channels):
        first = tiles[seats[i] // LANES, FIRST, seats[i] % LANES]
        for k in range(rows):
            deviations[i, k] = volts[start + k, columns[i]] - first
    # Each pass moves the largest remaining value to the end; the median needs half of the passes.
    for k in range(0, rows, LANES):
        for end in range(channels - 1, channels - channels // 2 - 2, -1):
            most = load(deviations, (0, k))
            for i in range(end):
                u = load(deviations, (i + 1, k))
                more = u > most
                store(select(more, most, u), deviations, (i, k))
                most = select(more, u, most)
            store(most, deviations, (end, k))
    low, high = deviations[(channels - 1) // 2], deviations[channels // 2]
    for k in range(rows):
        common_v[k] = 0.5 * (low[k] + high[k])


@compiled
def _of_row(kind, values, before_v):
    """Return the mean or median of a row's values; without values, the one of the row before."""
    n = values.size
    if n == 0:
        return before_v
    if kind == MEAN:
        total = 0.0
        for value in values:
            total += value
        return total / n
    values.sort()
    return 0.5 * (values[(n - 1) // 2] + values[n // 2])


@compiled_in_place
def find_common_mode(
    volts, start, rows, kind, bases, columns, seats, ranges, tiles, valid, deviations, common_v
):
    """Write the common mode of each row to ``common_v``; keep the first sample of each channel.

    Parameters
    ----------
    volts, start, rows
        The samples, the first row and the number of rows.
    kind
        ``MEAN`` or ``MEDIAN``.
    bases
        First column of each tile.
    columns, seats
        Column and seat of each enabled channel.
    ranges, tiles
        Ranges of good samples, and the state.
    valid
        Words by seat: the rows in which the channel has a good sample that is not flat.
    deviations
        Working memory, shape (channels, WORD_ROWS).
    common_v
        Output, shape (rows,) or more.
    """
    if (
        kind == MEDIAN
        and seats.size <= EXCHANGED_CHANNELS
        and _all_valid(rows, seats, tiles, valid)
    ):
        _medians(volts, start, rows, columns, seats, tiles, deviations, common_v)
        tiles[0, COMMON_V, 0] = common_v[rows - 1]
        return
    row, values = FIRST_ROW, deviations.reshape(-1)
    for k in range(rows):
        n = 0
        for i in range(seats.size):
            first = tiles[seats[i] // LANES, FIRST, seats[i] % LANES]
            if valid[seats[i]] & row and not np.isnan(first):
                values[n] = volts[start + k, columns[i]] - first
                n += 1
        row = row << FIRST_ROW
        common_v[k] = _of_row(kind, values[:n], tiles[0, COMMON_V, 0])
        tiles[0, COMMON_V, 0] = common_v[k]
        for t in range(bases.size):
            sample, first = load(volts, (start + k, bases[t])), load(tiles, (t, FIRST, 0))
            good = (sample >= load(ranges, (t, LOW, 0))) & (sample <= load(ranges, (t, HIGH, 0)))
            first = select(good, select(is_number(first), first, sample - common_v[k]), first)
            store(first, tiles, (t, FIRST, 0))
