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

"""Rules by which the stamp of a sample tells whether samples are missing before it; compiled.

A grid of times is a record of type :data:`GRID`, with the :data:`LATELY` latest messages in an
array of type :data:`LATEST`. Verdicts are numbers of missing samples, or :data:`DROPPED` or
:data:`NEW_STRETCH`.
"""

import math
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np

from slip_detector.compiled import COMPILED, compiled_for, compiled_in_place

#: Number of samples whose stamps the line of the grid is fitted to, after a start and later. A
#: long memory averages jitter and still follows a drift.
FIRST_MEMORY, LONG_MEMORY = 16, 256

#: Largest jitter, in periods. A sample further ahead of the grid begins a new grid.
LARGEST_JITTER = 2.0

#: Number of the latest messages that tell lost samples from another rate, and of those to which
#: the line is fitted again after a change of rate.
LATELY, AT_ANOTHER_RATE = 20, 8

#: How much better the stamps must fit losses than another rate, and another rate than losses, as
#: the F of a test of variances; the most messages after which one of them is taken in any case.
LOST_F, ANOTHER_RATE_F, DECIDED_AFTER = 3.0, 8.0, 12

#: The step before the sample after a gap is longer than usual by at least this share of the
#: missing rows.
GAP_STEP = 0.2

#: Number of samples after which observed jitter is forgotten.
JITTER_MEMORY = 2048

#: Largest error of a clock's rate, as a share, that the grid follows; a larger one means missing
#: samples. In spite of jitter, an error of 0.15 is not taken for missing samples.
LARGEST_RATE_ERROR = 0.17

#: Limit between jitter and a gap, in periods from stamp to stamp, without further knowledge.
GAP_PERIODS = 1.5

#: A sample that is late by this many periods comes after a gap, unless the jitter is larger.
BEHIND_A_GAP = 0.5

#: A late sample comes after a gap if the next sample is late by this many periods too.
STILL_LATE = 0.3

#: Longest delay of a message whose number follows the one before, or of bunched samples. In a
#: longer pause the source itself has stopped.
LONGEST_DELAY_NS = 1e9

#: Jitter in periods that is assumed before any was observed.
FIRST_JITTER = 0.75

#: Samples in a row that must agree until the clock counts as set.
SEVERAL = 4

#: Stamps closer than this, in periods, are close. If more than ``BUNCHED`` of about the last
#: ``BUNCH_MEMORY`` are, the stamps do not tell when samples were taken.
CLOSE_PERIODS, BUNCHED, BUNCH_MEMORY = 0.25, 0.25, 64

#: The state of a grid:
#:
#: - ``period_ns``, ``nominal_ns``: the period by the stamps, and the nominal one;
#: - ``last_ns``, ``until_next_ns``: the last sample's place on the line, and the time from there
#:   to the place of the next sample;
#: - ``memory``, ``jitter``: the memory of the line in messages, and the jitter in periods;
#: - ``close``, ``same``, ``bad``: shares, lately, of stamps that are close or equal to the one
#:   before, and of rows that were dropped or bridged;
#: - ``before_ns``, ``late``: the stamp before, and how many messages may be missing by it (-1: the
#:   stamp was early);
#: - ``first_elsewhere_ns``, ``elsewhere``: first stamp and number of the samples in a row that fit
#:   elsewhere;
#: - ``dropped_rows``: rows that were dropped and not made up for yet;
#: - ``wrong``: samples that were taken in spite of their stamps;
#: - ``undecided``: the messages since it has been open whether some are missing;
#: - ``held``, ``next_held``, ``last_held_ns``: of the latest messages the number, the place of the
#:   next one, and the stamp of the last one.
GRID = np.dtype((np.record, [
    ('period_ns', 'f8'), ('until_next_ns', 'f8'), ('memory', 'f8'), ('jitter', 'f8'),
    ('nominal_ns', 'f8'), ('close', 'f8'), ('same', 'f8'), ('bad', 'f8'),
    ('last_ns', 'i8'), ('before_ns', 'i8'), ('late', 'i8'), ('first_elsewhere_ns', 'i8'),
    ('elsewhere', 'i8'), ('dropped_rows', 'i8'), ('wrong', 'i8'), ('undecided', 'i8'),
    ('held', 'i8'), ('next_held', 'i8'), ('last_held_ns', 'i8'),
]))  # fmt: skip

#: One of the latest messages, which are a ring: the nominal periods since the message before, its
#: rows, and the rows that were found missing before it.
LATEST = np.dtype((np.record, [('periods', 'f8'), ('rows', 'f8'), ('missing', 'f8')]))


def new_records(n: int, dtype: np.dtype[np.void]) -> Any:
    """Return records of zeros; without Numba objects, which are faster than NumPy's records."""
    if COMPILED:
        return np.zeros(n, dtype)
    return [SimpleNamespace(**dict.fromkeys(dtype.names or (), 0)) for _ in range(n)]


#: In place of a stamp: there is none.
NONE = np.iinfo(np.int64).min

# In place of the number of missing samples before a sample: the sample does not fit and is
# dropped; or, after a long gap or when the clock was set, the sample begins a new stretch.
DROPPED, NEW_STRETCH = -1, -2


@compiled_in_place
def _begin(grid, latest, stamp_ns, verdict):
    """Begin a new grid at a stamp; return the verdict."""
    grid.last_ns, grid.late, grid.elsewhere, grid.dropped_rows = stamp_ns, 0, 0, 0
    grid.until_next_ns, grid.memory = grid.period_ns, FIRST_MEMORY
    grid.undecided, grid.held, grid.last_held_ns = 0, 0, stamp_ns
    _hold(grid, latest, stamp_ns, 0.0)
    return verdict


@compiled_in_place
def _hold(grid, latest, stamp_ns, rows):
    """Hold a message as the latest one."""
    at = grid.next_held
    latest[at].periods = (stamp_ns - grid.last_held_ns) / grid.nominal_ns
    latest[at].rows, latest[at].missing = rows, 0.0
    grid.last_held_ns, grid.next_held = stamp_ns, (at + 1) % LATELY
    grid.held = min(grid.held + 1, LATELY)


@compiled_in_place
def _fit(grid, latest, n, earlier, last, missing, late_rows):
    """Fit a line to the stamps of the latest ``n`` messages by their rows, by least squares.

    ``missing`` rows are taken to be missing before those of the ``last`` messages, ``late_rows``
    more before the very last, and those that were found missing earlier, if ``earlier`` is 1.0.
    Return the sum of squares, the slope (periods, over nominal ones, minus 1) and how late the
    last message is, in nominal periods.
    """
    x = t = late = sx = sy = sxx = sxy = syy = 0.0
    for i in range(n):
        at = (grid.next_held - n + i) % LATELY
        x += latest[at].rows + earlier * latest[at].missing + (missing if i == n - last else 0.0)
        x += late_rows if i == n - 1 else 0.0
        t += latest[at].periods
        late = t - x
        sx, sy = sx + x, sy + late
        sxx, sxy, syy = sxx + x * x, sxy + x * late, syy + late * late
    sxx, sxy, syy = sxx - sx * sx / n, sxy - sx * sy / n, syy - sy * sy / n
    slowest, fastest = 1.0 / (1.0 - LARGEST_RATE_ERROR), 1.0 / (1.0 + LARGEST_RATE_ERROR)
    slope = min(max(sxy / max(sxx, 1.0), fastest - 1.0), slowest - 1.0)
    squares = max(syy - 2.0 * slope * sxy + slope * slope * sxx, 0.0)
    return squares, slope, late - (sy + slope * (n * x - sx)) / n


@compiled_in_place
def _lost_or_slow(grid, latest, missing, late_rows):
    """Return ``missing`` if so many rows are missing before one of the latest messages.

    0: more messages have to come; -1: no rows are missing, and the line was fitted again. Where
    rows are lost, the latest stamps fit a line with a step. Where the rate has changed they fit a
    line without a step, perhaps with no rows missing earlier either; early stamps (``missing`` is
    0) can only mean that. More messages are awaited until one of the lines fits clearly better.
    """
    n = grid.held
    steady, _, _ = _fit(grid, latest, n, 1.0, 0, 0.0, 0.0)
    none_lost, _, _ = _fit(grid, latest, n, 0.0, 0, 0.0, 0.0)
    slow, lost, since = min(steady, none_lost), math.inf, 0
    for last in range(2, min(DECIDED_AFTER, n - 1) + 1 if missing > 0 else 0):
        at = (grid.next_held - last) % LATELY
        is_long = latest[at].periods > latest[at].rows + GAP_STEP * missing
        squares, _, _ = _fit(grid, latest, n, 1.0, last, float(missing), float(late_rows))
        if is_long and squares < lost:
            lost, since = squares, last
    if (slow - lost) * (n - 2) > LOST_F * lost:
        latest[(grid.next_held - since) % LATELY].missing += missing
        grid.undecided = 0
        return missing
    grid.undecided += 1
    is_open = (lost - slow) * (n - 2) <= ANOTHER_RATE_F * slow
    if is_open and grid.undecided < DECIDED_AFTER:
        return 0
    if none_lost < steady:
        for i in range(LATELY):
            latest[i].missing = 0.0
    grid.undecided, n = 0, min(n, AT_ANOTHER_RATE)
    _, slope, late = _fit(grid, latest, n, 1.0, 0, 0.0, 0.0)
    grid.period_ns = grid.nominal_ns * (1.0 + slope)
    grid.until_next_ns = grid.period_ns - late * grid.nominal_ns
    grid.memory = n
    return -1


@compiled_in_place
def _follow(grid, behind, rows):
    """Move the line towards the stamp of a message that is late by ``behind`` periods.

    The gains are those of a least-squares line through the last ``memory`` messages.
    """
    n = grid.memory
    if n < LONG_MEMORY:
        grid.memory = n + 1.0
    # Lateness beyond BEHIND_A_GAP may be a gap and not jitter; an early sample is always jitter.
    off = -behind if behind < 0.0 else min(behind, BEHIND_A_GAP)
    grid.jitter = max(off, grid.jitter * (1.0 - 1.0 / JITTER_MEMORY))
    gain = 1.0 / (n * (n + 1.0))
    period_ns = grid.period_ns
    # The time until the next sample: from this stamp to its place on the line, plus one period.
    on_line_ns = -behind * (1.0 - 2.0 * (2.0 * n - 1.0) * gain) * rows * period_ns
    period_ns *= 1.0 + behind * 6.0 * gain
    period_ns = max(period_ns, grid.nominal_ns / (1.0 + LARGEST_RATE_ERROR))
    period_ns = min(period_ns, grid.nominal_ns / (1.0 - LARGEST_RATE_ERROR))
    grid.period_ns = period_ns
    grid.until_next_ns = on_line_ns + period_ns


@compiled_in_place
def _judge_elsewhere(grid, latest, limit_ns, stamp_ns, rows, since_ns):
    """Return the verdict on a message that does not fit: the clock was set if several agree."""
    if grid.elsewhere == 0 or not 0 <= since_ns <= limit_ns + rows * grid.period_ns:
        grid.first_elsewhere_ns, grid.elsewhere = stamp_ns, 0
    grid.elsewhere += 1
    grid.dropped_rows += rows
    # Late messages too rise and are behind, but only for so long, and not where the grid is new.
    is_new = grid.held <= SEVERAL
    span_ns = stamp_ns - grid.first_elsewhere_ns
    is_set = stamp_ns > grid.last_ns or span_ns > limit_ns or is_new
    if grid.elsewhere < SEVERAL or not is_set:
        return DROPPED
    return _begin(grid, latest, stamp_ns, NEW_STRETCH)


@compiled_in_place
def _judge_by_number(grid, latest, max_gap_ns, stamp_ns, rows, lost, behind):
    """Return the verdict on a message before which ``lost`` messages are missing by its number."""
    step_ns = stamp_ns - grid.last_ns
    too_many = lost > 0 and (lost * rows + 0.5) * grid.period_ns > max_gap_ns
    if too_many or step_ns - rows * grid.period_ns > max(max_gap_ns, LONGEST_DELAY_NS):
        return _begin(grid, latest, stamp_ns, NEW_STRETCH)
    if step_ns <= 0:  # The clock was set back.
        return _begin(grid, latest, stamp_ns, lost * rows)
    _follow(grid, behind - lost, float(rows))
    grid.last_ns, grid.late = stamp_ns, 0
    grid.held, grid.last_held_ns = 0, stamp_ns
    _hold(grid, latest, stamp_ns, 0.0)
    return lost * rows


@compiled_in_place
def _judge_by_stamp(grid, latest, max_gap_ns, stamp_ns, rows, since_ns, behind):
    """Return the verdict on a message by its stamp, ``since_ns`` after the one before."""
    step_ns, message_ns = stamp_ns - grid.last_ns, rows * grid.period_ns
    close_ns = CLOSE_PERIODS * message_ns
    grid.close += ((0 <= since_ns < close_ns) - grid.close) / BUNCH_MEMORY
    grid.same += ((since_ns == 0) - grid.same) / BUNCH_MEMORY
    bunched = grid.close > BUNCHED
    limit_ns = max(max_gap_ns, LONGEST_DELAY_NS) if bunched else max_gap_ns
    jitter = max(0.0, grid.jitter - BEHIND_A_GAP)
    # Messages are missing as far as two stamps agree that are not of one bunch.
    missing = min(max(grid.late, 0), max(int(np.ceil(behind - jitter - STILL_LATE)), 0))
    missing *= since_ns > close_ns
    behind -= missing
    late = max(int(np.rint(behind - jitter)), 0)
    gap_rows = late * rows - grid.dropped_rows
    if 0 <= step_ns < 0.5 * message_ns and grid.elsewhere > 0:
        # Behind dropped ones that rise to the last one, this one is that one again.
        grid.elsewhere = 0
        return DROPPED
    if step_ns < 0 or (gap_rows > 0 and (gap_rows + 0.5) * grid.period_ns > limit_ns):
        return _judge_elsewhere(grid, latest, limit_ns, stamp_ns, rows, since_ns)
    if grid.late > 0 and missing == 0 and not bunched:
        grid.wrong += 1
        if grid.late > 1:  # Of the latest messages it gets its place, too.
            before = latest[(grid.next_held - 1) % LATELY]
            before.periods -= (grid.last_held_ns - grid.last_ns) / grid.nominal_ns
            grid.last_held_ns = grid.last_ns
    _hold(grid, latest, stamp_ns, float(rows))
    is_early = behind < -BEHIND_A_GAP
    if not bunched and (missing > 0 or (is_early and grid.late < 0)):
        found = _lost_or_slow(grid, latest, missing * rows, late * rows)
        if found < 0:
            grid.last_ns, grid.late, grid.elsewhere, grid.dropped_rows = stamp_ns, 0, 0, 0
            return 0
        if found == 0:
            behind, late, missing = behind + missing, late + missing, 0
    else:
        grid.undecided = 0
    if behind < -LARGEST_JITTER:
        return _begin(grid, latest, stamp_ns, missing * rows)
    _follow(grid, behind - late, float(rows))
    # The place on the line; of a bunch the rows are counted, and the line follows slowly.
    grid.last_ns = stamp_ns - int(late * message_ns * (1.0 - bunched / BUNCH_MEMORY))
    grid.late, grid.elsewhere = -1 if is_early else late, 0
    if late == 0:
        grid.dropped_rows = 0
    return missing * rows


@compiled_in_place
def _judge(grid, latest, max_gap_ns, stamp_ns, rows, lost):
    """Return the verdict on a message.

    ``lost`` messages are missing before it by its number; -1: only its stamp can tell.
    """
    since_ns = stamp_ns - grid.before_ns
    grid.before_ns = stamp_ns
    if grid.last_ns == NONE:
        return _begin(grid, latest, stamp_ns, 0)
    # In messages.
    step_ns, message_ns = stamp_ns - grid.last_ns, rows * grid.period_ns
    behind = (step_ns - grid.until_next_ns + grid.period_ns) / message_ns - 1.0
    if lost >= 0:
        return _judge_by_number(grid, latest, max_gap_ns, stamp_ns, rows, lost, behind)
    return _judge_by_stamp(grid, latest, max_gap_ns, stamp_ns, rows, since_ns, behind)


@compiled_in_place
def judge_all(grids, latest, max_gap_ns, stamps_ns, verdicts, places_ns):
    """Write the verdict of :func:`_judge` on each sample, by its stamp, and its place in time."""
    grid = grids[0]
    for i in range(stamps_ns.size):
        verdicts[i] = _judge(grid, latest, max_gap_ns, stamps_ns[i], 1, -1)
        places_ns[i] = grid.last_ns


@compiled_in_place
def arrive(grids, latest, max_gap_ns, stamp_ns, rows, lost):
    """Return the verdict of :func:`_judge`, and follow the share of dropped and bridged rows."""
    grid = grids[0]
    dropped = grid.dropped_rows
    missing = _judge(grid, latest, max_gap_ns, stamp_ns, rows, lost)
    is_dropped = missing == DROPPED
    bad = rows if is_dropped else max(missing - dropped, 0)
    # One gap alone, if it is bridged, stays below a half.
    share = grid.period_ns / max(LONGEST_DELAY_NS / 2, 2 * max_gap_ns)
    grid.bad = 1.0 - (1.0 - grid.bad) * math.exp(-bad * share)
    grid.bad *= 1.0 if is_dropped else math.exp(-rows * share)
    return missing


@cache
def compiled_arrive():
    """Return :func:`arrive` for calls from Python; the first call compiles or loads it.

    The types of its arguments are not checked.
    """
    grids, latest = new_records(1, GRID), new_records(LATELY, LATEST)
    return compiled_for(arrive, grids, latest, 0.0, 0, 0, 0)
