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

"""What needs all channels of a row: impacts, contact, the common mode and the votes of the groups.

The common mode is the mean or median of all valid channels of a row. It is computed from
deviations from each channel's first good sample. A common mode of the samples themselves would
jump whenever a channel has no good sample, as baselines differ by far more than the signal. A
channel that starts late is assumed to have followed the others until then.

A vote computes one number of a group from the levels of its valid channels, in their unit:

- ``all``: the smallest level: if it is above the threshold, all are;
- k: the k-th largest level;
- ``mean``: the geometric mean of the levels.

The group is ON where the number is above the threshold (the paper has ``all``, Table 1). The
number does not depend on the threshold, which can be chosen afterwards. If only the decision is
wanted, ``all`` and k are computed for 64 rows at once. A channel then has two words, with one bit
per row: where it is ON, and where it is valid.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain import decibels, layout, stages
from slip_detector.chain.stages import FIRST_ROW, NO_ROW
from slip_detector.compiled import compiled_in_place, compiled_within
from slip_detector.parameters import ChainConfig, convert
from slip_detector.vectors import LANES, floor, is_number, load, select, spread, store

#: The parameter ``common_mode`` as a number, its place in ``COMMON_MODES``; the other is the mean.
NO_COMMON_MODE, MEDIAN = range(2)

#: Numbers for the votes that are no count of channels.
VOTE_ALL, VOTE_MEAN = 0, -1
ONLY_MEAN = np.array([VOTE_MEAN])

#: Binary digits of a count of channels, more than any number of channels needs.
DIGITS = 32

#: Stands in place of the level of a channel that is not valid; lower than any level.
NO_VOTE = -1.0

# ln m = 2 (s + s^3/3 + s^5/5 + ...) with s = (m - 1) / (m + 1), and exp z = 1 + z + z^2/2 + ...:
# coefficients from the last to the first. The truncation error is below 1e-17 for m within
# [sqrt(1/2), sqrt(2)] and for z within [-0.75, 0.75].
LOGARITHM = tuple(2.0 / k for k in range(23, 0, -2))
EXPONENTIAL = tuple(1.0 / float(np.prod(np.arange(1.0, k + 1))) for k in range(18, -1, -1))
LN_2 = float(np.log(2.0))
ROOT_2 = float(np.sqrt(2.0))


@compiled_in_place
def rows_of_count(count, members, words, valid, digits):
    """Return the rows in which at least ``count`` valid members have their bit in ``words``.

    The counts of 64 rows are binary numbers. Each word of ``digits`` holds one digit of all of
    them, so that counting a member adds one bit to 64 numbers at once.
    """
    digits[:] = NO_ROW
    for m in members:
        carry, p = words[m] & valid[m], 0
        while carry:
            digits[p], carry = digits[p] ^ carry, digits[p] & carry
            p += 1
    # Compare from the highest digit on: rows whose count is larger, rows equal so far.
    more, equal = NO_ROW, ~NO_ROW
    for p in range(DIGITS - 1, -1, -1):
        wanted = ~NO_ROW if (count >> p) & 1 else NO_ROW
        more |= equal & digits[p] & ~wanted
        equal &= ~(digits[p] ^ wanted)
    return more | equal


@compiled_in_place
def _rows_held(begins, renews, rows, hold_rows, tiles, slot):
    """Return the rows within a hold time, as a word.

    The hold time begins anew in the rows of the word ``begins``, and in those of ``renews`` that
    are within a hold time. The state keeps the number of rows that remain.
    """
    left = min(int(tiles[0, slot, 0]), hold_rows)
    held, row = NO_ROW, FIRST_ROW
    for _ in range(rows):
        if begins & row or (left > 0 and renews & row):
            left = hold_rows
        if left > 0:
            held |= row
            left -= 1
        row = row << FIRST_ROW
    tiles[0, slot, 0] = left
    return held


@compiled_within
def rows_of_impact(rows, settings, plan, steps, tiles):
    """Return the rows within the hold time of an impact, as a word."""
    impacts = rows_of_count(settings.impact_channels, plan.members, steps, steps, plan.digits)
    return _rows_held(impacts, NO_ROW, rows, settings.hold_rows, tiles, layout.HOLD_ROWS)


@compiled_in_place
def rows_of_contact(rows, settings, plan, words, tiles):
    """Return the rows in contact and those that touch, as words.

    Contact begins where enough valid channels are above the level of contact, and goes on where
    enough are above the lower level. In these rows the finger touches. Contact is held for some
    rows more.
    """
    count, valid = settings.contact_channels, words[stages.VALID]
    begins = rows_of_count(count, plan.members, words[stages.TOUCHES], valid, plan.digits)
    renews = rows_of_count(count, plan.members, words[stages.GOES_ON], valid, plan.digits)
    contact = _rows_held(begins, renews, rows, settings.contact_rows, tiles, layout.CONTACT_ROWS)
    return contact, contact & (begins | renews)


@compiled_in_place
def _transpose(block, rows, at, by_channel):
    """Copy the rows of a tile to ``by_channel``, shape (columns, rows), from column ``at`` on."""
    for lane in range(LANES):
        for k in range(rows):
            by_channel[at + lane, k] = block[k, lane]


@compiled_in_place
def _find_averages(volts, start, rows, plan, valid, tiles, take_median):
    """Write the mean or median of the channels that have begun to ``common_v``, else NaN."""
    deviations, members = plan.by_channel, plan.members
    for t in range(tiles.shape[0]):
        block, at, row = plan.blocks[t], t * LANES, FIRST_ROW
        first = load(tiles, (t, layout.FIRST, 0))
        begun = select(is_number(first), load(valid, (at,)), NO_ROW)
        for k in range(rows):
            deviation = load(volts, (start + k, at)) - first
            store(select((begun & row) != NO_ROW, deviation, -np.inf), block, (k, 0))
            row = row << FIRST_ROW
        _transpose(block, rows, at, deviations)
    for k in range(0, rows, LANES):
        count, total = spread(0.0), spread(0.0)
        for c in range(valid.size):
            deviation = load(deviations, (c, k))
            there = deviation > -np.inf
            count = count + select(there, 1.0, 0.0)
            total = total + select(there, deviation, 0.0)
        average = total / count
        if take_median:
            _sort(deviations, members, members.size // 2 + 1, k)
            low, high = average, average
            for i in range(members.size // 2 + 1):
                deviation = load(deviations, (members[-1 - i], k))
                low = select(count >= 2.0 * i, deviation, low)
                high = select(count > 2.0 * i, deviation, high)
            average = 0.5 * (low + high)
        store(average, plan.common_v, (k,))


@compiled_in_place
def _begin_channels(volts, start, rows, plan, valid, tiles):
    """Keep the first samples of the channels that begin next; return whether any do."""
    begin = rows
    for c in plan.members:
        for k in range(begin if np.isnan(tiles[c // LANES, layout.FIRST, c % LANES]) else 0):
            if (valid[c] >> np.uint64(k)) & FIRST_ROW:
                begin = k
                break
    if begin == rows:
        return False
    for c in plan.members:
        first = tiles[c // LANES, layout.FIRST, c % LANES]
        if np.isnan(first) and (valid[c] >> np.uint64(begin)) & FIRST_ROW:
            first = volts[start + begin, c] - plan.common_v[begin]
            tiles[c // LANES, layout.FIRST, c % LANES] = first
    return True


@compiled_within
def find_common_mode(volts, start, rows, settings, plan, valid, tiles):
    """Find the common mode of each row, that of the row before where no channel is valid.

    A channel counts after the row in which it begins: its first sample is kept less the common
    mode of that row.
    """
    common_v, begins = plan.common_v, True
    while begins:
        _find_averages(volts, start, rows, plan, valid, tiles, settings.common_mode == MEDIAN)
        before_v = tiles[0, layout.COMMON_V, 0]
        for k in range(rows):
            before_v = before_v if np.isnan(common_v[k]) else common_v[k]
            common_v[k] = before_v
        begins = _begin_channels(volts, start, rows, plan, valid, tiles)
    tiles[0, layout.COMMON_V, 0] = before_v


@compiled_within
def find_common_excess(rows, settings, plan):
    """Write the common excess of each row: the r-th smallest excess over the floor, in dB.

    It is at least 0, of the channels that count, and 0 where r channels or fewer count.
    """
    rank, members, lower = settings.common_rank, plan.members, plan.by_channel
    for c in members:
        for k in range(rows):
            lower[c, k] = -plan.low[c // LANES, k, c % LANES]
    for k in range(0, rows, LANES):
        _sort(lower, members, rank + 1, k)
    for k in range(rows):
        known = rank < members.size and lower[members[-1 - rank], k] > -np.inf
        plan.common_db[k] = -lower[members[-rank], k] if known else 0.0


def vote_numbers(votes: Sequence[str | int]) -> NDArray[np.int64]:
    """Return votes as numbers for the kernel: each is ``all``, ``mean`` or a count of channels.

    Examples
    --------
    >>> vote_numbers(['all', 'mean', 2])
    array([ 0, -1,  2])
    """
    field = ChainConfig.__dataclass_fields__['vote']
    checked = [convert(vote, field, 'vote') for vote in votes]
    numbers = [{'all': VOTE_ALL, 'mean': VOTE_MEAN}.get(vote, vote) for vote in checked]
    return np.array(numbers, dtype=np.int64)


@compiled_in_place
def gather_levels(block, rows, valid, at, levels):
    """Copy the levels of a tile to ``levels``, shape (columns, rows), from column ``at`` on."""
    row = FIRST_ROW
    for k in range(rows):
        level = load(block, (k, 0))
        level = select(level > 0.0, level, 0.0)  # also where it is NaN
        store(select((valid & row) != NO_ROW, level, NO_VOTE), block, (k, 0))
        row = row << FIRST_ROW
    _transpose(block, rows, at, levels)


@compiled_in_place
def _extremes(levels, members, k):
    """Return the smallest and the largest valid level of sixteen rows, else infinity, NO_VOTE."""
    least, most = spread(np.inf), spread(NO_VOTE)
    for m in members:
        level = load(levels, (m, k))
        least = select((level >= 0.0) & (level < least), level, least)
        most = select(level > most, level, most)
    return least, most


@compiled_in_place
def _geometric_mean(levels, members, least, most, k):
    """Return the geometric mean of a group's valid levels in sixteen rows, NO_VOTE without any.

    All operations have a rounding defined by IEEE 754; the logarithms of two libraries may differ
    in their last bits. The exponents of the product are split off and added, so that nothing over-
    or underflows: no configuration has levels beyond 1e-300 and 1e300.
    """
    count, exponent, product = spread(0.0), spread(0.0), spread(1.0)
    for m in members:
        level = load(levels, (m, k))
        valid = level >= 0.0
        product = select(valid, product * level, product)
        exponent = exponent + decibels.exponents(product)
        product = decibels.fractions(product)
        count = count + select(valid, spread(1.0), spread(0.0))
    count = select(count > 0.0, count, 1.0)
    large = product > ROOT_2
    exponent = select(large, exponent + 1.0, exponent)
    product = select(large, product * 0.5, product)
    # The mean logarithm is a whole number, to base 2, and the rest, to base e.
    whole = floor(exponent / count + 0.5)
    s = (product - 1.0) / (product + 1.0)
    rest = ((exponent - whole * count) * LN_2 + s * decibels.polynomial(LOGARITHM, s * s)) / count
    mean = decibels.polynomial(EXPONENTIAL, rest) * decibels.powers_of_2(whole)
    # Rounding must not take the mean beyond the levels; the mean of equal levels is that level.
    mean = select(mean < least, least, mean)
    mean = select(mean > most, most, mean)
    mean = select(most < np.inf, mean, most)
    return select(least > 0.0, mean, 0.0)


@compiled_in_place
def _sort(levels, members, count, k):
    """Move the ``count`` largest levels of sixteen rows to the end, the largest last.

    Sorting one row takes an unpredictable branch for each pair; exchanging values in sixteen rows
    at once takes none.
    """
    for i in range(min(count, members.size)):
        before = members[0]
        most = load(levels, (before, k))
        for m in members[1 : members.size - i]:
            level = load(levels, (m, k))
            above = level > most
            store(select(above, most, level), levels, (before, k))
            most, before = select(above, level, most), m
        store(most, levels, (before, k))


@compiled_in_place
def find_statistics(levels, members, bounds, rows, votes, statistics):
    """Write the statistic of each vote: the largest number of the groups, 0 where none can vote.

    Parameters
    ----------
    levels
        Shape (columns, rows, padded to whole vectors), with ``NO_VOTE`` for a channel that is not
        valid; the order of a group's members is not kept.
    members, bounds
        Columns of the members of all groups, and where those of each group begin and end.
    rows
        Number of rows.
    votes
        As returned by :func:`vote_numbers`.
    statistics
        Output, shape (votes, rows, padded to whole vectors).
    """
    most_counted, mean_wanted = 0, False
    for vote in votes:
        most_counted, mean_wanted = max(most_counted, vote), mean_wanted or vote == VOTE_MEAN
    for k in range(0, rows, LANES):
        for v in range(votes.size):
            store(spread(0.0), statistics, (v, k))
        for g in range(bounds.size - 1):
            group = members[bounds[g] : bounds[g + 1]]
            least, most = _extremes(levels, group, k)
            mean = _geometric_mean(levels, group, least, most, k) if mean_wanted else most
            _sort(levels, group, most_counted, k)
            for v in range(votes.size):
                if votes[v] > group.size:
                    continue
                if votes[v] > 0:
                    number = load(levels, (group[-votes[v]], k))
                else:
                    number = least if votes[v] == VOTE_ALL else mean
                before = load(statistics, (v, k))
                larger = (most >= 0.0) & (number > before)
                store(select(larger, number, before), statistics, (v, k))


@compiled_within
def decide(rows, settings, plan, on, valid):
    """Write the words of all flags: the votes of the groups (Table 1), their OR, the channels'."""
    bounds, decisions, slip = plan.bounds, plan.decisions, NO_ROW
    for g in range(bounds.size - 1):
        group = plan.members[bounds[g] : bounds[g + 1]]
        can_vote, against, decision = NO_ROW, NO_ROW, NO_ROW
        if settings.vote > 0:
            can_vote = rows_of_count(settings.vote, group, valid, valid, plan.digits)
            decision = rows_of_count(settings.vote, group, on, valid, plan.digits)
        else:
            for m in group:
                can_vote |= valid[m]
                against |= valid[m] & ~on[m]
            decision = can_vote & ~against
        if settings.vote == VOTE_MEAN:
            row, decision = FIRST_ROW, NO_ROW
            group_bounds = bounds[g : g + 2]
            find_statistics(
                plan.by_channel, plan.members, group_bounds, rows, ONLY_MEAN, plan.statistics
            )
            for k in range(rows):
                decision |= row if plan.statistics[0, k] > settings.threshold else NO_ROW
                row = row << FIRST_ROW
        decisions[settings.groups_at + g] = decision
        decisions[settings.can_vote_at + g] = can_vote
        slip |= decision
    decisions[0] = slip
    for c in range(settings.channels):
        decisions[settings.channels_at + c] = on[c]
        decisions[settings.valid_at + c] = valid[c]
