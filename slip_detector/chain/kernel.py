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

"""The kernel: all stages of the chain over rows of volts, from samples to decisions.

It is plain Python that Numba compiles; without Numba the same functions run interpreted, with the
same bits. The kernel processes channels in tiles of sixteen (:mod:`slip_detector.chain.lanes`) and
rows in blocks of at most 64, so that the data of a block stay in the first-level cache. All blocks
of a chunk pass one tile before the next tile, so that the tile's state stays there too. No result
of a row depends on where a block, a chunk or a call begins, so any cut of the rows gives the same
bits.
"""

from functools import cache

import numpy as np

from slip_detector.chain.common_mode import NO_COMMON_MODE, find_common_mode
from slip_detector.chain.compiled import as_silent, compiled_for, compiled_in_place
from slip_detector.chain.evidence import (
    gains_of_evidence,
    hold_evidence,
    rows_of_impact,
    sum_evidence,
)
from slip_detector.chain.lanes import LANES, LINE, load, spread, store
from slip_detector.chain.plan import parts_of
from slip_detector.chain.stages import (
    ENVELOPE_HEAD,
    ENVELOPE_ROW,
    FIRST_ROW,
    FIXED_SLOTS,
    LEVEL_HEAD,
    LEVEL_ROW,
    NO_ROW,
    WORD_ROWS,
    check_samples,
    keep_roots,
    load_deviations,
    rectified_power,
    rows_above,
    run_filters,
    take_off_mains,
    window_means,
)
from slip_detector.chain.votes import (
    VOTE_ALL,
    VOTE_MEAN,
    gather_levels,
    raise_to_votes,
    rows_of_all,
    rows_of_any,
    rows_of_count,
)

#: Signals of more values than this (2 MB) are written past the caches: an ordinary store would
#: first fetch the cache line that it overwrites.
CACHED_VALUES = 2**18

#: Bits of the argument ``kept``: which signals are wanted, in the order of their columns.
KEEP_ENVELOPE, KEEP_LEVEL, KEEP_FLOOR, KEEP_EXCESS = 1, 2, 4, 8

#: The types of the arguments of :func:`run`.
SIGNATURE = (
    '(float64[:, ::1], boolean[:, ::1], float64[:, ::1], float64[:, :, ::1], float64[::1], int64)'
)

#: The vote ``mean`` alone, in the form that :func:`raise_to_votes` takes.
MEAN_ALONE = np.array([VOTE_MEAN])


@compiled_in_place
def _decide(rows, vote, threshold, on, valid, layout, scratch):
    """Compute the vote of each group's valid channels (Table 1) and the OR of the groups."""
    n_groups, slip = layout.bounds.size - 1, NO_ROW
    for g in range(n_groups):
        first, end = layout.bounds[g], layout.bounds[g + 1]
        members = layout.members[first:end]
        if vote > 0:
            able = rows_of_count(vote, members, valid, valid, scratch.digits)
            decision = rows_of_count(vote, members, on, valid, scratch.digits)
        else:
            able = rows_of_any(members, valid)
            if vote == VOTE_ALL:
                decision = rows_of_all(members, on, valid)
            else:
                scratch.mean[:] = 0.0
                bounds = layout.bounds[g : g + 2]
                raise_to_votes(scratch.levels, bounds, rows, MEAN_ALONE, scratch.mean)
                decision, row = NO_ROW, FIRST_ROW
                for k in range(rows):
                    decision |= row if scratch.mean[0, k] > threshold else NO_ROW
                    row = row << FIRST_ROW
        scratch.decisions[1 + g], scratch.decisions[1 + n_groups + g] = decision, able
        slip |= decision
    scratch.decisions[0] = slip
    first, channels = 1 + 2 * n_groups, layout.flag_seats.size
    for c in range(channels):
        seat = layout.flag_seats[c]
        scratch.decisions[first + c] = on[seat]
        scratch.decisions[first + channels + c] = valid[seat]


@compiled_in_place
def _write_flags(decisions, flags, start, rows):
    """Write each word to a column of flags: one byte for each of its bits."""
    width = flags.shape[1]
    if width < LANES:
        for i in range(width):
            word = decisions[i]
            for k in range(start, start + rows):
                flags[k, i] = word & FIRST_ROW != NO_ROW
                word = word >> FIRST_ROW
        return
    for first in range(0, width, LANES):
        i = min(first, width - LANES)
        words, row = load(decisions, i), spread(FIRST_ROW)
        for k in range(start, start + rows):
            store((words & row) != NO_ROW, flags, (k, i))
            row = row + row


@compiled_in_place
def _write_statistics(rows, layout, threshold, scratch, signals, start):
    """Write the statistic of each vote (above 1: ON) to the last columns of ``signals``."""
    scratch.statistics[:] = 0.0
    raise_to_votes(scratch.levels, layout.bounds, rows, layout.votes, scratch.statistics)
    column = signals.shape[1] - layout.votes.size
    for v in range(layout.votes.size):
        if threshold != 1.0:  # saves the division for the tuner, which sets 1
            for k in range(0, rows, LANES):
                store(load(scratch.statistics, (v, k)) / threshold, scratch.statistics, (v, k))
        for k in range(rows):
            signals[start + k, column + v] = scratch.statistics[v, k]


@compiled_in_place
def _take_all_channels(volts, chunk, end, settings, ranges, layout, tiles, scratch):
    """Run the stages that need all channels of a row: check of samples, impacts, common mode."""
    for start in range(chunk, end, WORD_ROWS):
        rows, w = min(WORD_ROWS, end - start), (start - chunk) // WORD_ROWS
        if settings.impact_v > 0.0:
            scratch.held[w] = rows_of_impact(
                volts, start, rows, settings, ranges, layout, tiles, scratch.steps, scratch.digits
            )
        for t in range(layout.bases.size):
            check_samples(
                volts, start, rows, layout.bases[t], ranges[t], settings.flat_rows, tiles[t],
                scratch.valid, (w, t * LANES),
            )  # fmt: skip
        if settings.common_mode != NO_COMMON_MODE:
            find_common_mode(
                volts, start, rows, int(settings.common_mode), layout.bases, layout.columns,
                layout.seats, ranges, tiles, scratch.valid[w], scratch.deviations,
                scratch.common_v[w],
            )  # fmt: skip


@compiled_in_place
def _column(kept, signal, column, width):
    """Return the column of a tile in a signal of the output; -1 if the signal is not wanted.

    ``column`` is the tile's first column within a signal, ``width`` the number of columns of one.
    """
    if kept & signal == 0:
        return -1
    before = kept & (signal - 1)
    return column + width * ((before & 1) + ((before >> 1) & 1) + (before >> 2))


@compiled_in_place
def _run_tile(
    volts, chunk, end, t, settings, checked, tile_range, least_db, sections, layout, tile, scratch,
    signals, kept, past_caches,
):  # fmt: skip
    """Run the rows of a chunk through one tile, up to the ON and valid bits of its channels.

    ``checked`` tells whether the samples have been checked already.
    """
    block, column, width = scratch.block, layout.bases[t], volts.shape[1]
    comb_rows = int(settings.comb_rows)
    envelope_rows, level_rows = int(settings.envelope_rows), int(settings.level_rows)
    comb_tail = FIXED_SLOTS + 2 * sections.shape[0]
    envelope_tail = comb_tail + comb_rows
    level_tail = envelope_tail + envelope_rows + 1
    envelope_column = _column(kept, KEEP_ENVELOPE, column, width)
    level_column = _column(kept, KEEP_LEVEL, column, width)
    for start in range(chunk, end, WORD_ROWS):
        rows, at = min(WORD_ROWS, end - start), ((start - chunk) // WORD_ROWS, t * LANES)
        if not checked:
            check_samples(
                volts, start, rows, column, tile_range, settings.flat_rows, tile, scratch.valid, at
            )
        load_deviations(
            volts, start, rows, column, tile_range, scratch.common_v[at[0]], tile, block
        )
        if comb_rows > 0:
            take_off_mains(block, rows, comb_rows, load(scratch.valid, at), tile, comb_tail)
        run_filters(block, rows, sections, tile)
        rectified_power(block, rows, settings.full_wave != 0.0, int(settings.exponent))
        if settings.evidence:
            window_means(
                block, rows, envelope_rows, tile, ENVELOPE_ROW, ENVELOPE_HEAD, envelope_tail,
                False, signals, start, -1, False,
            )  # fmt: skip
            if envelope_column >= 0:
                keep_roots(block, rows, signals, start, envelope_column)
            gains_of_evidence(
                block, rows, settings, load(least_db, (t, 0)),
                settings.comb_rows + settings.envelope_rows,
                load(scratch.valid, at), scratch.held[at[0]], tile, signals, start,
                _column(kept, KEEP_FLOOR, column, width),
                _column(kept, KEEP_EXCESS, column, width),
            )  # fmt: skip
            sum_evidence(
                block, rows, settings.limit_db_s, tile, signals, start, level_column,
                past_caches and level_column % LINE == 0,
            )  # fmt: skip
            hold_evidence(block, rows, tile)
        else:
            window_means(
                block, rows, envelope_rows, tile, ENVELOPE_ROW, ENVELOPE_HEAD, envelope_tail,
                True, signals, start, envelope_column, past_caches and envelope_column % LINE == 0,
            )  # fmt: skip
            window_means(
                block, rows, level_rows, tile, LEVEL_ROW, LEVEL_HEAD, level_tail,
                False, signals, start, level_column, past_caches and level_column % LINE == 0,
            )  # fmt: skip
        rows_above(block, rows, settings.threshold, scratch.on, at)
        if scratch.levels.size:
            gather_levels(block, rows, scratch.valid, at, scratch.levels, layout.places)


@compiled_in_place
def _write_held(held, signals, column, start, rows):
    """Write 1 for the rows within the hold time of an impact, 0 for the others."""
    for k in range(start, start + rows):
        signals[k, column] = 1.0 if held & FIRST_ROW else 0.0
        held = held >> FIRST_ROW


@as_silent
@compiled_in_place
def run(volts, flags, signals, tiles, plan, kept):
    """Run all stages over all rows, from ``volts`` to ``flags`` and ``signals``.

    Parameters
    ----------
    volts
        Rows of volts, shape (n, columns), at least sixteen columns.
    flags
        Output of decisions, shape (n, 1 + 2 g + 2 c): slip, groups, whether each group can vote,
        channels, valid.
    signals
        Output of envelope, level, floor and excess, as far as they are wanted, each with as many
        columns as ``volts``; with excess, a column that is 1 within the hold time of an impact;
        then the statistics of v votes, one column each.
    tiles
        The state, shape (t, slots, 16).
    plan
        See :mod:`slip_detector.chain.plan`.
    kept
        The bits of the signals that are wanted.
    """
    settings, ranges, least_db, sections, layout, scratch = parts_of(plan)
    # The size is compared first, as an empty array has no address.
    past_caches = (
        signals.size > CACHED_VALUES
        and signals.shape[1] % LINE == 0
        and signals.ctypes.data % (LINE * signals.itemsize) == 0
    )
    # Without detection of impacts nothing else writes these words.
    scratch.held[:] = NO_ROW
    checked = settings.common_mode != NO_COMMON_MODE or settings.impact_v > 0.0
    chunk_rows = scratch.on.shape[0] * WORD_ROWS
    for chunk in range(0, volts.shape[0], chunk_rows):
        end = min(chunk + chunk_rows, volts.shape[0])
        if checked:
            _take_all_channels(volts, chunk, end, settings, ranges, layout, tiles, scratch)
        for t in range(layout.bases.size):
            _run_tile(
                volts, chunk, end, t, settings, checked, ranges[t], least_db, sections, layout,
                tiles[t], scratch, signals, kept, past_caches,
            )  # fmt: skip
        for start in range(chunk, end, WORD_ROWS):
            rows, w = min(WORD_ROWS, end - start), (start - chunk) // WORD_ROWS
            on, valid = scratch.on[w], scratch.valid[w]
            _decide(rows, int(settings.vote), settings.threshold, on, valid, layout, scratch)
            _write_flags(scratch.decisions, flags, start, rows)
            if kept & KEEP_EXCESS:
                column = signals.shape[1] - layout.votes.size - 1
                _write_held(scratch.held[w], signals, column, start, rows)
            if layout.votes.size:
                _write_statistics(rows, layout, settings.threshold, scratch, signals, start)


@cache
def kernel():
    """Return :func:`run` for calls from Python; the first call compiles or loads it.

    The arguments must have the types of :data:`SIGNATURE`, which are not checked.
    """
    return compiled_for(SIGNATURE, run)
