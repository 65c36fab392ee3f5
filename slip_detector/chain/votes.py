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

Each vote computes this number from the levels of the valid channels, in the unit of the level:

- ``all``: the smallest level: if it is above the threshold, all are;
- k: the k-th largest level;
- ``mean``: the geometric mean of the levels.

The group is ON where the number is above the threshold (the paper has ``all``, Table 1). The
number does not depend on the threshold, which can be chosen afterwards.

If only the decision is wanted, ``all`` and k are computed for 64 rows at once, from words with one
bit per row for where a channel is ON and where it is valid. The numbers are computed from levels
of shape (members, rows), with :data:`NO_VOTE` for a channel that is not valid.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import as_silent, compiled_in_place
from slip_detector.chain.lanes import (
    LANES,
    floor,
    in_all,
    load,
    select,
    spread,
    store,
)
from slip_detector.chain.logarithms import exponents, fractions, polynomial, powers_of_2
from slip_detector.chain.stages import FIRST_ROW, NO_ROW

#: Numbers that stand for the votes that are not a count of channels.
VOTE_ALL, VOTE_MEAN = 0, -1

#: Binary digits of a count of channels, more than any number of channels needs.
DIGITS = 32

#: In place of the level of a channel that is not valid; less than any level.
NO_VOTE = -1.0

#: The least normal float64; smaller ones are scaled by 2^54 before they are split into parts.
LEAST_NORMAL = 2.0**-1022
SCALE_BITS = 54.0

#: A product of at most ``FEW`` factors, each below ``LARGE`` and above its inverse, neither over-
#: nor underflows.
FEW, LARGE = 16, 2.0**62

#: If two products differ by a smaller share than this, rounding may swap the order of their means.
NEAR = 1e-12

#: A product of this many factors, each below 2, does not overflow.
FACTORS = 512

# ln m = 2 (s + s^3/3 + s^5/5 + ...) with s = (m - 1) / (m + 1), and exp z = 1 + z + z^2/2 + ...:
# coefficients from the last to the first. The truncation error is below 1e-17 for m within
# [sqrt(1/2), sqrt(2)] and for z within [-0.75, 0.75].
LOGARITHM = tuple(2.0 / k for k in range(23, 0, -2))
EXPONENTIAL = tuple(1.0 / float(np.prod(np.arange(1.0, k + 1))) for k in range(18, -1, -1))
LN_2 = float(np.log(2.0))
ROOT_2 = float(np.sqrt(2.0))


def vote_numbers(votes: Sequence[str | int]) -> NDArray[np.int64]:
    """Return votes as numbers for the kernel.

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


@compiled_in_place
def rows_of_all(members, on, valid):
    """Return the rows in which all valid members are ON and at least one member is valid."""
    able, against = NO_ROW, NO_ROW
    for m in members:
        able |= valid[m]
        against |= valid[m] & ~on[m]
    return able & ~against


@compiled_in_place
def rows_of_any(members, valid):
    """Return the rows in which any member is valid."""
    able = NO_ROW
    for m in members:
        able |= valid[m]
    return able


@compiled_in_place
def rows_of_count(count, members, words, valid, digits):
    """Return the rows in which at least ``count`` valid members have their bit in ``words``.

    The counts of 64 rows are binary numbers, and each word of ``digits`` holds one digit of all of
    them: counting a member adds one bit to 64 numbers at once.
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
def gather_levels(block, rows, valid, at, levels, places):
    """Copy the levels of a tile to ``levels``, which has a row for each member of a group.

    ``at`` is the index of the tile's words in ``valid``: number of the word, seat of lane 0.
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


@compiled_in_place
def _raise(number, able, statistics, at):
    """Raise a statistic of sixteen rows to a number if that is larger and the group can vote."""
    before = load(statistics, at)
    store(select(able & (number > before), number, before), statistics, at)


@compiled_in_place
def _extremes(levels, first, end, k):
    """Return the smallest and the largest valid level of sixteen rows.

    In rows without a valid level they are infinity and ``NO_VOTE``.
    """
    least, most = spread(np.inf), spread(NO_VOTE)
    for j in range(first, end):
        level = load(levels, (j, k))
        least = select((level >= 0.0) & (level < least), level, least)
        most = select(level > most, level, most)
    return least, most


@compiled_in_place
def _plain_product(levels, first, end, k):
    """Return the number of valid levels in each of sixteen rows, and their product."""
    count, product = spread(0.0), spread(1.0)
    for j in range(first, end):
        level = load(levels, (j, k))
        valid = level >= 0.0
        count = count + select(valid, spread(1.0), spread(0.0))
        product = select(valid, product * level, product)
    return count, product


@compiled_in_place
def _product(levels, first, end, k):
    """Return the number of valid levels in each of sixteen rows, and their product in two parts.

    Fractions are multiplied and exponents are added, so that nothing over- or underflows. If the
    plain product does not either, its fraction has the same bits.
    """
    count, exponent, product = spread(0.0), spread(0.0), spread(1.0)
    for j in range(first, end):
        level = load(levels, (j, k))
        valid = level >= 0.0
        small = level < LEAST_NORMAL
        level = select(small, level * 2.0**SCALE_BITS, level)
        own = exponents(level) - select(small, spread(SCALE_BITS), spread(0.0))
        count = count + select(valid, spread(1.0), spread(0.0))
        exponent = select(valid, exponent + own, exponent)
        product = select(valid, product * fractions(level), product)
        if (j - first) % FACTORS == FACTORS - 1:
            exponent = exponent + exponents(product)
            product = fractions(product)
    return count, exponent + exponents(product), fractions(product)


@compiled_in_place
def _mean_logarithm(count, exponent, product):
    """Return the mean logarithm of the levels in each of sixteen rows, in two parts.

    The first part is a whole number, to base 2; the second is the rest, to base e. ``exponent``
    and ``product`` are the parts of the product of ``count`` levels.
    """
    large = product > ROOT_2
    exponent = select(large, exponent + 1.0, exponent)
    product = select(large, product * 0.5, product)
    count = select(count > 0.0, count, 1.0)
    whole = floor(exponent / count + 0.5)
    s = (product - 1.0) / (product + 1.0)
    logarithm = s * polynomial(LOGARITHM, s * s)
    return whole, ((exponent - whole * count) * LN_2 + logarithm) / count


@compiled_in_place
def _raise_to_mean(count, exponent, product, least, most, statistics, at):
    """Raise a statistic to the geometric mean of a group's valid levels of sixteen rows.

    ``least`` and ``most`` are the extremes of these levels, and ``exponent`` and ``product`` the
    parts of their product.

    It uses only operations with a rounding defined by IEEE 754, as the logarithms of two libraries
    may differ in their last bits.
    """
    whole, rest = _mean_logarithm(count, exponent, product)
    # The power is applied in two steps, as the smallest means are below 2^-1022.
    half = floor(whole * 0.5)
    mean = polynomial(EXPONENTIAL, rest) * powers_of_2(half) * powers_of_2(whole - half)
    # Rounding must not take the mean beyond the levels; the mean of equal levels is that level.
    mean = select(mean < least, least, mean)
    mean = select(mean > most, most, mean)
    mean = select(most < np.inf, mean, most)
    mean = select(least > 0.0, mean, 0.0)
    _raise(mean, most >= 0.0, statistics, at)


@compiled_in_place
def _raise_to_means(levels, bounds, k, statistics, v):
    """Raise a statistic of sixteen rows to the geometric means of groups.

    Among groups with equally many valid channels, the largest product has the largest mean. So one
    root is computed for several groups, unless rounding could decide between two of them.
    """
    waiting = False
    count = product = least = most = spread(0.0)
    for g in range(bounds.size - 1):
        first, end = bounds[g], bounds[g + 1]
        low, high = _extremes(levels, first, end, k)
        if end - first > FEW or not in_all((high < LARGE) & (low > 1.0 / LARGE)):
            own_count, exponent, fraction = _product(levels, first, end, k)
            _raise_to_mean(own_count, exponent, fraction, low, high, statistics, (v, k))
            continue
        own_count, own = _plain_product(levels, first, end, k)
        apart = (own < product * (1.0 - NEAR)) | (own > product * (1.0 + NEAR))
        if waiting and in_all((own_count == count) & apart):
            larger = own > product
            product = select(larger, own, product)
            least, most = select(larger, low, least), select(larger, high, most)
            continue
        if waiting:
            _raise_to_mean(
                count, exponents(product), fractions(product), least, most, statistics, (v, k)
            )
        waiting, count, product, least, most = True, own_count, own, low, high
    if waiting:
        _raise_to_mean(
            count, exponents(product), fractions(product), least, most, statistics, (v, k)
        )


@compiled_in_place
def _sort(levels, first, end, count, k):
    """Move the ``count`` largest levels of sixteen rows to the front, the largest first."""
    for i in range(first, first + count):
        most = load(levels, (end - 1, k))
        for j in range(end - 2, i - 1, -1):
            level = load(levels, (j, k))
            above = level > most
            store(select(above, most, level), levels, (j + 1, k))
            most = select(above, level, most)
        store(most, levels, (i, k))


@as_silent
@compiled_in_place
def raise_to_votes(levels, bounds, rows, votes, statistics):
    """Raise the statistic of each vote to the largest number of the groups, if that is larger.

    Parameters
    ----------
    levels
        Shape (members of all groups, rows, padded to whole vectors); the order of a group's
        members is not kept.
    bounds
        Index of the first member of each group, and the end of the last one.
    rows
        Number of rows.
    votes
        As returned by :func:`vote_numbers`.
    statistics
        Shape (votes, rows, padded to whole vectors), not below 0; unchanged where no group can
        vote.
    """
    most_counted = 0
    for vote in votes:
        most_counted = max(most_counted, vote)
    for k in range(0, rows, LANES):
        for v in range(votes.size):
            if votes[v] == VOTE_MEAN:
                _raise_to_means(levels, bounds, k, statistics, v)
        for g in range(bounds.size - 1):
            first, end = bounds[g], bounds[g + 1]
            least, most = _extremes(levels, first, end, k)
            for v in range(votes.size):
                if votes[v] == VOTE_ALL:
                    _raise(least, most >= 0.0, statistics, (v, k))
            _sort(levels, first, end, min(most_counted, end - first), k)
            for v in range(votes.size):
                if 0 < votes[v] <= end - first:
                    number = load(levels, (first + votes[v] - 1, k))
                    _raise(number, number >= 0.0, statistics, (v, k))
