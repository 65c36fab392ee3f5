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

"""The vote of a group: one number, which is compared with the threshold.

Each vote computes it from the levels of the valid channels, in the level's own unit:

- ``all``: the least of them: where it is above the threshold, all are;
- k: the k-th largest;
- ``mean``: the geometric mean.

The group is ON where that number is above the threshold (the paper has ``all``, Table 1). The
number does not depend on the threshold, which can be chosen afterwards.

Where only the decision is asked for, ``all`` and k are computed for 64 rows at once, from words
with a bit a row that tell where a channel is ON and where it is valid. The numbers are computed
from levels of shape (members, rows), where :data:`NO_VOTE` stands for a channel that is not valid.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import as_silent, compiled
from slip_detector.chain.lanes import (
    LANES,
    floor,
    load,
    select,
    spread,
    store,
)
from slip_detector.chain.logarithms import exponents, fractions, polynomial, powers_of_2
from slip_detector.chain.stages import FIRST_ROW, NO_ROW

#: The votes that are not a count of channels, as numbers.
VOTE_ALL, VOTE_MEAN = 0, -1

#: Binary digits of a count of channels; there are never as many channels as they can count.
DIGITS = 32

#: Stands for the level of a channel that is not valid: less than any level.
NO_VOTE = -1.0

#: The least normal float64; smaller ones are scaled by 2^54 before they are split into parts.
LEAST_NORMAL = 2.0**-1022
SCALE_BITS = 54.0

#: A product of this many factors, each below 2, does not overflow.
FACTORS = 512

# ln m = 2 (s + s^3/3 + s^5/5 + ...) with s = (m - 1) / (m + 1), and exp z = 1 + z + z^2/2 + ...:
# coefficients from the last to the first. What is left out is below 1e-17 for m within
# [sqrt(1/2), sqrt(2)] and for z within [-0.75, 0.75].
LOGARITHM = tuple(2.0 / k for k in range(23, 0, -2))
EXPONENTIAL = tuple(1.0 / float(np.prod(np.arange(1.0, k + 1))) for k in range(18, -1, -1))
LN_2 = float(np.log(2.0))
ROOT_2 = float(np.sqrt(2.0))


def vote_numbers(votes: Sequence[str | int]) -> NDArray[np.int64]:
    """Return votes as numbers, which the kernel takes.

    Parameters
    ----------
    votes
        Each ``all``, ``mean`` or a count of channels.

    Raises
    ------
    ValueError
        When a vote is none of these.

    Examples
    --------
    >>> vote_numbers(['all', 'mean', 2])
    array([ 0, -1,  2])
    """
    numbers = []
    for vote in votes:
        count = isinstance(vote, (int, np.integer)) and not isinstance(vote, bool) and vote >= 1
        if not count and vote not in ('all', 'mean'):
            raise ValueError(f'vote is {vote!r}, allowed: all, mean or a count of 1 or more')
        numbers.append({'all': VOTE_ALL, 'mean': VOTE_MEAN}.get(str(vote), vote))
    return np.array(numbers, dtype=np.int64)


@compiled
def rows_of_all(members, on, valid):
    """Return the rows in which all valid members are ON, and there is one."""
    able, against = NO_ROW, NO_ROW
    for m in members:
        able |= valid[m]
        against |= valid[m] & ~on[m]
    return able & ~against


@compiled
def rows_of_any(members, valid):
    """Return the rows in which any member is valid."""
    able = NO_ROW
    for m in members:
        able |= valid[m]
    return able


@compiled
def rows_of_count(count, members, words, valid, digits):
    """Return the rows in which at least ``count`` valid members have their bit in ``words``.

    The counts of 64 rows are binary numbers, and each word of ``digits`` holds one digit of all of
    them: to count a member is to add one bit to 64 numbers at once.
    """
    digits[:] = NO_ROW
    for m in members:
        carry, p = words[m] & valid[m], 0
        while carry:
            digits[p], carry = digits[p] ^ carry, digits[p] & carry
            p += 1
    # From the highest digit on: where the count is more, and where it is equal so far.
    more, equal = NO_ROW, ~NO_ROW
    for p in range(DIGITS - 1, -1, -1):
        wanted = ~NO_ROW if (count >> p) & 1 else NO_ROW
        more |= equal & digits[p] & ~wanted
        equal &= ~(digits[p] ^ wanted)
    return more | equal


@compiled
def gather_levels(block, rows, valid, at, levels, places):
    """Copy the levels of a tile to ``levels``, which has a row for each member of a group.

    The tile's words in ``valid`` begin at ``at``: the word's number and the tile's first seat.
    ``places`` has the row in ``levels`` of each seat, -1 for none.
    """
    row = FIRST_ROW
    words = load(valid, at)
    for k in range(rows):
        level = load(block, (k, 0))
        level = select(level > 0.0, level, 0.0)  # also where it is NaN
        store(select((words & row) != NO_ROW, level, NO_VOTE), block, (k, 0))
        row = row << FIRST_ROW
    for lane in range(LANES):
        place = places[at[1] + lane]
        if place >= 0:
            own = levels[place]
            for k in range(rows):
                own[k] = block[k, lane]


@compiled
def _extremes(levels, members, k):
    """Return the least valid level of sixteen rows and the largest.

    Where none is valid they are infinity and ``NO_VOTE``.
    """
    least, most = spread(np.inf), spread(NO_VOTE)
    for j in range(members):
        level = load(levels, (j, k))
        least = select((level >= 0.0) & (level < least), level, least)
        most = select(level > most, level, most)
    return least, most


@compiled
def _product(levels, members, k):
    """Return how many levels of sixteen rows are valid, and their product in two parts.

    Fractions are multiplied and exponents are added, so that nothing over- or underflows.
    """
    count, exponent, product = spread(0.0), spread(0.0), spread(1.0)
    for j in range(members):
        level = load(levels, (j, k))
        valid = level >= 0.0
        small = level < LEAST_NORMAL
        level = select(small, level * 2.0**SCALE_BITS, level)
        own = exponents(level) - select(small, spread(SCALE_BITS), spread(0.0))
        count = count + select(valid, spread(1.0), spread(0.0))
        exponent = select(valid, exponent + own, exponent)
        product = select(valid, product * fractions(level), product)
        if j % FACTORS == FACTORS - 1:
            exponent = exponent + exponents(product)
            product = fractions(product)
    return count, exponent + exponents(product), fractions(product)


@compiled
def _mean_logarithm(levels, members, k):
    """Return the mean logarithm of sixteen rows in two parts.

    The first is a whole number, to base 2, the second the rest, to base e.
    """
    count, exponent, product = _product(levels, members, k)
    large = product > ROOT_2
    exponent = select(large, exponent + 1.0, exponent)
    product = select(large, product * 0.5, product)
    count = select(count > 0.0, count, 1.0)
    whole = floor(exponent / count + 0.5)
    s = (product - 1.0) / (product + 1.0)
    logarithm = s * polynomial(LOGARITHM, s * s)
    return whole, ((exponent - whole * count) * LN_2 + logarithm) / count


@compiled
def _geometric_mean(levels, members, k, least, most):
    """Return the geometric mean of the valid levels of sixteen rows; any where there is none.

    ``least`` and ``most`` are the extremes of these levels.

    All operations are those whose rounding IEEE 754 defines; the logarithms of two libraries may
    differ in their last bits.
    """
    whole, rest = _mean_logarithm(levels, members, k)
    # In two steps: the smallest numbers are below 2^-1022.
    half = floor(whole * 0.5)
    mean = polynomial(EXPONENTIAL, rest) * powers_of_2(half) * powers_of_2(whole - half)
    # Not beyond the levels by rounding: of equal levels it is that level.
    mean = select(mean < least, least, mean)
    mean = select(mean > most, most, mean)
    mean = select(most < np.inf, mean, most)
    return select(least > 0.0, mean, 0.0)


@compiled
def _sort(levels, members, count, k):
    """Bring the ``count`` largest levels of sixteen rows to the front, the largest first."""
    for i in range(count):
        most = load(levels, (members - 1, k))
        for j in range(members - 2, i - 1, -1):
            level = load(levels, (j, k))
            above = level > most
            store(select(above, most, level), levels, (j + 1, k))
            most = select(above, level, most)
        store(most, levels, (i, k))


@as_silent
@compiled
def raise_to_votes(levels, members, rows, votes, statistics):
    """Raise the statistic of each vote to the number of one group, where that is larger.

    Parameters
    ----------
    levels
        Shape (members, rows) or more, rows in whole vectors; their order is not kept.
    members, rows
        How many of each there are.
    votes
        As :func:`vote_numbers` returns them.
    statistics
        Shape (votes, rows or more in whole vectors), not less than 0; it stays where the group
        cannot vote.
    """
    most_counted = 0
    for vote in votes:
        most_counted = max(most_counted, vote)
    most_counted = min(most_counted, members)
    for k in range(0, rows, LANES):
        least, most = _extremes(levels, members, k)
        able = most >= 0.0
        for v in range(votes.size):
            if votes[v] <= 0:
                if votes[v] == VOTE_ALL:
                    number = least
                else:
                    number = _geometric_mean(levels, members, k, least, most)
                before = load(statistics, (v, k))
                store(select(able & (number > before), number, before), statistics, (v, k))
        _sort(levels, members, most_counted, k)
        for v in range(votes.size):
            if 0 < votes[v] <= members:
                number, before = load(levels, (votes[v] - 1, k)), load(statistics, (v, k))
                store(select(number > before, number, before), statistics, (v, k))
