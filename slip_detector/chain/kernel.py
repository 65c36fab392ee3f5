"""The kernel: all stages of the chain over rows of volts, from samples to decisions.

It is plain Python that Numba compiles; where Numba is missing the same functions run interpreted,
to the same bits. Rows are taken in blocks of at most 64 and channels in tiles of eight
(:mod:`slip_detector.chain.lanes`), so that what a block needs stays in the first-level cache.
Nothing that is computed for a row depends on where a block or a call begins, hence any cut of the
rows gives the same bits.

A *seat* is a channel's place in the tiles: eight times its tile, and its lane. Tiles may overlap;
then a channel's seat is in the first of them, and in the other it is computed to the same bits.
"""

from typing import NamedTuple

import numpy as np

from slip_detector.chain.common_mode import NO_COMMON_MODE, find_common_mode
from slip_detector.chain.compiled import as_silent, compiled
from slip_detector.chain.lanes import LANES, load, spread, store
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
    keep,
    load_deviations,
    rectified_power,
    rows_above,
    run_filters,
    window_means,
)
from slip_detector.chain.votes import (
    DIGITS,
    VOTE_ALL,
    VOTE_MEAN,
    raise_to_votes,
    rows_of_all,
    rows_of_any,
    rows_of_count,
    seat_levels,
)

MEAN_ALONE = np.array([VOTE_MEAN])


class Settings(NamedTuple):
    """What the kernel needs of a configuration beside its arrays, as numbers.

    Attributes
    ----------
    flat_rows : float
        Repeats of a sample from which on a channel is flat; may be infinite.
    threshold : float
    common_mode : float
        Place in :data:`slip_detector.chain.common_mode.COMMON_MODES`.
    full_wave : float
        0 for half-wave.
    exponent : float
    vote : float
        As :func:`slip_detector.chain.votes.vote_numbers` has it.
    envelope_rows, level_rows : float
        Lengths of the windows.
    enabled, groups, tiles : float
        How many channels, groups and tiles there are.
    """

    flat_rows: float
    threshold: float
    common_mode: float
    full_wave: float
    exponent: float
    vote: float
    envelope_rows: float
    level_rows: float
    enabled: float
    groups: float
    tiles: float


class Layout(NamedTuple):
    """Where the channels are, in a chain of e enabled channels, t tiles, g groups and v votes.

    Attributes
    ----------
    bases : ndarray of int, shape (t,)
        First column of each tile.
    columns, seats : ndarray of int, shape (e,)
        Column and seat of each enabled channel.
    places : ndarray of int, shape (8 t,)
        Row of the rooms for the votes by seat: the groups' members one after the other; -1 for
        none.
    bounds : ndarray of int, shape (g + 1,)
        Where each group begins and ends among all members.
    members : ndarray of int, shape (e,)
        Their seats.
    votes : ndarray of int, shape (v,)
        Whose statistic is wanted.
    flag_seats : ndarray of int, shape (c,)
        Seat of each channel of the result; 8 t for a disabled one.
    """

    bases: np.ndarray
    columns: np.ndarray
    seats: np.ndarray
    places: np.ndarray
    bounds: np.ndarray
    members: np.ndarray
    votes: np.ndarray
    flag_seats: np.ndarray


@compiled
def _settings(numbers):
    """Give names to numbers: passed as a tuple they would cost each call a microsecond."""
    return Settings(
        numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5],
        numbers[6], numbers[7], numbers[8], numbers[9], numbers[10],
    )  # fmt: skip


@compiled
def _layout(places, enabled, groups, tiles, votes):
    """Give names to the parts of one array: each array that is passed costs a call 50 ns."""
    columns = tiles
    seats = columns + enabled
    of_seats = seats + enabled
    bounds = of_seats + tiles * LANES
    members = bounds + groups + 1
    wanted = members + enabled
    flag_seats = wanted + votes
    return Layout(
        places[:columns],
        places[columns:seats],
        places[seats:of_seats],
        places[of_seats:bounds],
        places[bounds:members],
        places[members:wanted],
        places[wanted:flag_seats],
        places[flag_seats:],
    )


def room_size(settings: Settings, width: int, votes: int) -> int:
    """Return how many float64 the kernel needs to work in.

    Parameters
    ----------
    settings
        Of the chain.
    width
        Columns of its flags.
    votes
        Whose statistic is wanted.
    """
    seats = int(settings.tiles) * LANES + 1
    block = WORD_ROWS * LANES + WORD_ROWS + DIGITS + 2 * seats + width + WORD_ROWS
    rooms = int(settings.enabled) * WORD_ROWS
    with_deviations = settings.common_mode != NO_COMMON_MODE
    with_levels = settings.vote == VOTE_MEAN or votes > 0
    return block + rooms * (with_deviations + with_levels) + votes * WORD_ROWS


@compiled
def _decide(rows, vote, threshold, layout, on, valid, digits, levels, mean, decisions):
    """Let each group's valid channels vote (Table 1) and take the OR of the groups."""
    n_groups = layout.bounds.size - 1
    slip = NO_ROW
    for g in range(n_groups):
        first, end = layout.bounds[g], layout.bounds[g + 1]
        members = layout.members[first:end]
        if vote == VOTE_ALL:
            able = rows_of_any(members, valid)
            decision = rows_of_all(members, on, valid)
        elif vote == VOTE_MEAN:
            able = rows_of_any(members, valid)
            decision = NO_ROW
            mean[:] = 0.0
            raise_to_votes(levels[first:end], end - first, rows, MEAN_ALONE, mean)
            row = FIRST_ROW
            for k in range(rows):
                if mean[0, k] > threshold:
                    decision |= row
                row = row << FIRST_ROW
        else:
            able = rows_of_count(vote, members, valid, valid, digits)
            decision = rows_of_count(vote, members, on, valid, digits)
        decisions[1 + g], decisions[1 + n_groups + g] = decision, able
        slip |= decision
    decisions[0] = slip


@compiled
def _write_flags(decisions, flags, start, rows):
    """Write words as a byte a row."""
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


@compiled
def _write_statistics(levels, rows, layout, threshold, statistics, signals, start):
    """Write what each vote holds against 1 to the last columns of ``signals``."""
    statistics[:] = 0.0
    for g in range(layout.bounds.size - 1):
        first, end = layout.bounds[g], layout.bounds[g + 1]
        raise_to_votes(levels[first:end], end - first, rows, layout.votes, statistics)
    column = signals.shape[1] - layout.votes.size
    for v in range(layout.votes.size):
        for k in range(rows):
            signals[start + k, column + v] = statistics[v, k] / threshold


@as_silent
@compiled
def run(volts, flags, signals, tiles, room, numbers, places, kept):
    """Run all stages over all rows, from ``volts`` to ``flags`` and ``signals``.

    Parameters
    ----------
    volts
        Rows of volts, shape (n, columns), at least eight columns.
    flags
        Decisions, shape (n, 1 + 2 g + 2 c): slip, groups, whether they can vote, channels, valid.
    signals
        What is kept, shape (n, columns, twice the columns or none, and v): envelope, level and
        statistic of the votes.
    tiles
        The state, shape (t, slots, 8).
    room
        To work in; see :func:`room_size`.
    numbers
        :class:`Settings`, then the tiles' ranges of good samples, shape (t, 2, 8), and the
        sections, shape (s, 6).
    places
        :class:`Layout`.
    kept
        1 when the envelope is kept, and 2 when the level is, as a sum; then 4 times v.
    """
    settings = _settings(numbers)
    threshold, vote = settings.threshold, int(settings.vote)
    common_mode, exponent = int(settings.common_mode), int(settings.exponent)
    enabled, groups, n_tiles = int(settings.enabled), int(settings.groups), int(settings.tiles)
    votes = kept // 4
    layout = _layout(places, enabled, groups, n_tiles, votes)
    end = len(settings) + n_tiles * 2 * LANES
    ranges = numbers[len(settings) : end].reshape(n_tiles, 2, LANES)
    sections = numbers[end:].reshape(-1, 6)
    envelope_tail = FIXED_SLOTS + 2 * sections.shape[0]
    level_tail = envelope_tail + int(settings.envelope_rows) + 1

    width, seats = flags.shape[1], n_tiles * LANES + 1
    at = WORD_ROWS * LANES
    block, common_v = room[:at].reshape(WORD_ROWS, LANES), room[at : at + WORD_ROWS]
    at += WORD_ROWS
    words = room[at : at + DIGITS + 2 * seats + width].view(np.uint64)
    digits, on, valid = words[:DIGITS], words[DIGITS : DIGITS + seats], words[DIGITS + seats :]
    decisions = valid[seats:]
    at += words.size
    mean = room[at : at + WORD_ROWS].reshape(1, WORD_ROWS)
    at += WORD_ROWS
    size = 0 if common_mode == NO_COMMON_MODE else enabled * WORD_ROWS
    deviations = room[at : at + size].reshape(-1, WORD_ROWS)
    at += size
    size = enabled * WORD_ROWS if vote == VOTE_MEAN or votes > 0 else 0
    levels = room[at : at + size].reshape(-1, WORD_ROWS)
    at += size
    statistics = room[at : at + votes * WORD_ROWS].reshape(-1, WORD_ROWS)

    for start in range(0, volts.shape[0], WORD_ROWS):
        rows = min(WORD_ROWS, volts.shape[0] - start)
        if common_mode != NO_COMMON_MODE:
            for t in range(n_tiles):
                check_samples(
                    volts, start, rows, layout.bases[t], ranges[t], settings.flat_rows,
                    tiles[t], valid, t * LANES,
                )  # fmt: skip
            find_common_mode(
                volts, start, rows, common_mode, layout.bases, layout.columns, layout.seats,
                ranges, tiles, valid, deviations, common_v,
            )  # fmt: skip
        for t in range(n_tiles):
            tile, column = tiles[t], layout.bases[t]
            if common_mode == NO_COMMON_MODE:
                check_samples(
                    volts, start, rows, column, ranges[t], settings.flat_rows, tile, valid,
                    t * LANES,
                )  # fmt: skip
            load_deviations(volts, start, rows, column, ranges[t], common_v, tile, block)
            run_filters(block, rows, sections, tile)
            rectified_power(block, rows, settings.full_wave != 0.0, exponent)
            window_means(
                block, rows, int(settings.envelope_rows), tile, ENVELOPE_ROW, ENVELOPE_HEAD,
                envelope_tail, True,
            )  # fmt: skip
            if kept & 1:
                keep(block, rows, signals, start, column)
            window_means(
                block, rows, int(settings.level_rows), tile, LEVEL_ROW, LEVEL_HEAD, level_tail,
                False,
            )  # fmt: skip
            if kept & 2:
                keep(block, rows, signals, start, column + (volts.shape[1] if kept & 1 else 0))
            rows_above(block, rows, threshold, on, t * LANES)
            if levels.size:
                of_tile = layout.places[t * LANES : (t + 1) * LANES]
                seat_levels(block, rows, valid, t, levels, of_tile)
        _decide(rows, vote, threshold, layout, on, valid, digits, levels, mean, decisions)
        first = 1 + 2 * groups
        for c in range(layout.flag_seats.size):
            decisions[first + c] = on[layout.flag_seats[c]]
            decisions[first + layout.flag_seats.size + c] = valid[layout.flag_seats[c]]
        _write_flags(decisions, flags, start, rows)
        if votes > 0:
            _write_statistics(levels, rows, layout, threshold, statistics, signals, start)
