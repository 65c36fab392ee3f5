"""The kernel: all stages of the chain over rows of volts, from samples to decisions.

It is plain Python that Numba compiles; where Numba is missing the same functions run interpreted,
to the same bits. Rows are taken in blocks of :data:`BLOCK_ROWS` and channels in tiles of at most
:data:`TILE_LANES`, so that a tile's state stays in the first-level cache and the inner loops, over
the lanes of a tile, become vector instructions. Nothing that is computed for a row depends on
where a block or a call begins, hence any cut of the rows gives the same bits.
"""

from typing import NamedTuple

import numpy as np

from slip_detector.chain.compiled import as_silent, compiled
from slip_detector.chain.votes import VOTE_ALL, VOTE_MEAN, level_of_voter, raise_to_votes

BLOCK_ROWS = 32
TILE_LANES = 32

#: Up to so many channels are ordered for the median by exchanges, a block of rows at a time.
EXCHANGED_CHANNELS = 32

#: Rows whose votes are taken at a time.
VOTE_ROWS = 64

COMMON_MODES = ('none', 'mean', 'median')
NO_COMMON_MODE, MEAN, MEDIAN = range(3)

# Slots of a tile's state before those of the sections and windows, one value a lane each.
LAST, COUNT, FIRST, HELD, ENVELOPE_HEAD, LEVEL_HEAD, FIXED_SLOTS = range(7)

# Numbers that a chain remembers, beside those of its channels.
ENVELOPE_ROW, LEVEL_ROW, COMMON_V = range(3)


class Settings(NamedTuple):
    """What the kernel needs of a configuration, as numbers.

    Attributes
    ----------
    low_v, high_v : float
        Lowest and highest good sample.
    flat_rows : float
        Repeats of a sample from which on a channel is flat; may be infinite.
    threshold : float
    common_mode : float
        Place in :data:`COMMON_MODES`.
    full_wave : float
        0 for half-wave.
    exponent : float
    vote : float
        As :func:`slip_detector.chain.votes.vote_numbers` has it.
    envelope_rows, level_rows : float
        Lengths of the windows.
    """

    low_v: float
    high_v: float
    flat_rows: float
    threshold: float
    common_mode: float
    full_wave: float
    exponent: float
    vote: float
    envelope_rows: float
    level_rows: float


@compiled
def _settings(numbers):
    """Give names to numbers: as a tuple they would cost each call a microsecond."""
    return Settings(
        numbers[0], numbers[1], numbers[2], numbers[3], numbers[4],
        numbers[5], numbers[6], numbers[7], numbers[8], numbers[9],
    )  # fmt: skip


@compiled
def _check_samples(volts, start, rows, a, b, low, high, flat_rows, tile, flags, valid):
    """Mark bad and flat samples of one tile; remember the last good value and its repeats."""
    last, count = tile[LAST], tile[COUNT]
    for r in range(start, start + rows):
        row, marks = volts[r][a:b], flags[r][valid + a : valid + b]
        for i in range(row.size):
            value = row[i]
            before, repeats = last[i], count[i]
            ok = (value >= low) & (value <= high)  # false for NaN too
            again = repeats + 1.0
            again = again if value == before else 0.0
            again = again if ok else repeats
            count[i] = again
            last[i] = value if ok else before
            marks[i] = ok & (again < flat_rows)


@compiled
def exchange(a, b):
    """Put the larger of each pair of values into ``a``, the smaller into ``b``."""
    for i in range(a.size):
        u, v = a[i], b[i]
        a[i] = u if u > v else v
        b[i] = v if u > v else u


@compiled
def _medians(volts, start, rows, tiles, deviations, shared):
    """Write the medians of rows in which all channels count, side by side in vector registers.

    A sort of one row has an unpredictable branch for each pair.
    """
    channels, lanes = volts.shape[1], tiles.shape[2]
    for i in range(channels):
        first, lane = tiles[i // lanes, FIRST, i % lanes], deviations[i]
        for k in range(rows):
            lane[k] = volts[start + k, i] - first
    # The larger half is enough: what is left is below it.
    for i in range(channels // 2 + 1):
        for j in range(channels - 1, i, -1):
            exchange(deviations[j - 1][:rows], deviations[j][:rows])
    low, high = deviations[channels // 2], deviations[(channels - 1) // 2]
    for k in range(rows):
        shared[k] = 0.5 * (low[k] + high[k])


@compiled
def _common_mode(
    volts, start, rows, low, high, kind, tiles, flags, valid, counters, deviations, shared
):
    """Write each row's mean or median deviation of the valid channels to ``shared``.

    Deviations are from each channel's first good value: baselines differ by far more than the
    signal, and a channel that leaves for a row would otherwise step all others. A channel that
    starts late is taken to have followed the others until then.
    """
    lanes = tiles.shape[2]
    if kind == MEDIAN and deviations.shape[1] == BLOCK_ROWS:
        whole = True
        for i in range(volts.shape[1]):
            whole &= not np.isnan(tiles[i // lanes, FIRST, i % lanes])
        for k in range(rows):
            marks = flags[start + k][valid:]
            for i in range(marks.size):
                whole &= marks[i]
        if whole:
            _medians(volts, start, rows, tiles, deviations, shared)
            counters[COMMON_V] = shared[rows - 1]
            return
    for k in range(rows):
        row, marks = volts[start + k], flags[start + k][valid:]
        n = 0
        for i in range(row.size):
            first = tiles[i // lanes, FIRST, i % lanes]
            if marks[i] and not np.isnan(first):
                deviations[n, 0] = row[i] - first
                n += 1
        if n and kind == MEAN:
            total = 0.0
            for i in range(n):
                total += deviations[i, 0]
            counters[COMMON_V] = total / n
        elif n:
            values = deviations[:n, 0]
            values.sort()
            middle = 0.5 * (values[(n - 1) // 2] + values[n // 2])
            counters[COMMON_V] = middle
        shared[k] = counters[COMMON_V]
        for i in range(row.size):
            first = tiles[i // lanes, FIRST, i % lanes]
            if np.isnan(first) and row[i] >= low and row[i] <= high:
                tiles[i // lanes, FIRST, i % lanes] = row[i] - shared[k]


@compiled
def _load(volts, start, rows, a, b, low, high, shared, tile, block):
    """Write the filter input of one tile to ``block``: deviations from the first good value.

    The network passes no constant, so the deviation from the first value, filtered from rest, is
    the value itself filtered from the steady state of that value; without its rounding errors.
    """
    first, held = tile[FIRST], tile[HELD]
    for k in range(rows):
        row, x = volts[start + k][a:b], block[k]
        common = shared[k]
        for i in range(row.size):
            value = row[i]
            begin, before = first[i], held[i]
            ok = (value >= low) & (value <= high)
            begin = value if ok & np.isnan(begin) else begin
            deviation = (value - begin) - common
            deviation = deviation if ok else before
            first[i] = begin
            held[i] = deviation
            x[i] = deviation


@compiled
def _filter(block, rows, sections, delays):
    """Run a block through the sections (transposed direct form II), two at a time, in place.

    What a section keeps for the next row must be stored before that row can start; a second
    section in the same pass works while the first one waits.
    """
    for s in range(0, sections.shape[0], 2):
        b0, b1, b2 = sections[s, 0], sections[s, 1], sections[s, 2]
        a1, a2 = sections[s, 4], sections[s, 5]
        d0, d1, d2 = sections[s + 1, 0], sections[s + 1, 1], sections[s + 1, 2]
        c1, c2 = sections[s + 1, 4], sections[s + 1, 5]
        z0, z1 = delays[2 * s], delays[2 * s + 1]
        w0, w1 = delays[2 * s + 2], delays[2 * s + 3]
        for k in range(rows):
            x = block[k]
            for i in range(x.size):
                u = x[i]
                v = b0 * u + z0[i]
                z0[i] = (b1 * u + z1[i]) - a1 * v
                z1[i] = b2 * u - a2 * v
                y = d0 * v + w0[i]
                w0[i] = (d1 * v + w1[i]) - c1 * y
                w1[i] = d2 * v - c2 * y
                x[i] = y


@compiled
def _rectified_power(block, power, rows, full_wave, exponent):
    """Rectify (Eq. 3) and raise to the exponent (Eq. 5), then square for the RMS (Eq. 6)."""
    if exponent == 3:  # The paper's, in one pass.
        for k in range(rows):
            x, p = block[k], power[k]
            for i in range(x.size):
                u = x[i]
                half = u if u > 0.0 else 0.0
                u = abs(u) if full_wave else half
                cube = u * u * u
                p[i] = cube * cube
        return
    for k in range(rows):
        x, p = block[k], power[k]
        for i in range(x.size):
            u = x[i]
            half = u if u > 0.0 else 0.0
            x[i] = abs(u) if full_wave else half
            p[i] = x[i]
    for _ in range(exponent - 1):
        for k in range(rows):
            x, p = block[k], power[k]
            for i in range(x.size):
                p[i] *= x[i]
    for k in range(rows):
        p = power[k]
        for i in range(p.size):
            p[i] *= p[i]


@compiled
def _window_means(values, rows, window, position, head, tail, root):
    """Replace each value by the mean of the last ``window`` values, zeros before the first.

    Time is cut into stretches of ``window`` rows: a sum is the head of the present stretch and
    the tail of the one before, whose tails are summed once when it ends. Only sums of terms, no
    differences: a huge value leaves nothing behind when it leaves the window. With ``root`` it is
    the root of the mean.

    Returns the position within the stretch after the last row.
    """
    per = 1.0 / window
    for k in range(rows):
        v = values[k]
        new, old = tail[position], tail[position + 1]
        for i in range(v.size):
            u = v[i]
            total = head[i] + u
            head[i] = total
            new[i] = u
            mean = (total + old[i]) * per
            v[i] = np.sqrt(mean) if root else mean
        position += 1
        if position == window:
            position = 0
            for j in range(window - 2, -1, -1):
                a, b = tail[j], tail[j + 1]
                for i in range(v.size):
                    a[i] += b[i]
            for i in range(v.size):
                head[i] = 0.0
    return position


@compiled
def _keep(values, rows, signals, start, a, b):
    """Copy a tile's values to columns ``a`` to ``b`` of the result."""
    for k in range(rows):
        v, to = values[k], signals[start + k][a:b]
        for i in range(to.size):
            to[i] = v[i]


@compiled
def _show_levels(level, rows, place, flags, start, valid, levels):
    """Write a tile's levels to the rooms of their groups, which vote later."""
    for i in range(place.size):
        room = levels[place[i]]
        for k in range(rows):
            room[k] = level_of_voter(level[k, i], flags[start + k, valid + i])


@compiled
def _mean_votes(levels, rows, bounds, only_mean, scores):
    """Write the geometric mean of each group's levels to ``scores``."""
    scores[:] = 0.0
    for g in range(bounds.size - 1):
        room = levels[bounds[g] : bounds[g + 1]]
        raise_to_votes(room, room.shape[0], rows, only_mean, scores[g : g + 1])


@compiled
def _vote(start, rows, members, bounds, vote, threshold, scores, flags, channels, valid):
    """Let each group's valid channels vote (Table 1) and take the OR of the groups."""
    n_groups = bounds.size - 1
    for k in range(rows):
        row = flags[start + k]
        if k > 0 and vote != VOTE_MEAN:
            # As good as always the channels say what they said in the row before.
            before = flags[start + k - 1]
            now, then = row[channels:], before[channels:]
            differ = False
            for i in range(now.size):
                differ |= now[i] ^ then[i]
            if not differ:
                for i in range(channels):
                    row[i] = before[i]
                continue
        on, marks = row[channels:valid], row[valid:]
        slip = False
        for g in range(n_groups):
            n_valid = 0
            n_on = 0
            for j in range(bounds[g], bounds[g + 1]):
                mark = marks[members[j]]
                n_valid += mark
                n_on += mark & on[members[j]]
            if vote == VOTE_ALL:
                able = n_valid > 0
                decision = able & (n_on == n_valid)
            elif vote == VOTE_MEAN:
                able = n_valid > 0
                decision = able & (scores[g, k] > threshold)
            else:
                able = n_valid >= vote
                decision = n_on >= vote
            row[1 + g] = decision
            row[1 + n_groups + g] = able
            slip = slip | decision
        row[0] = slip


@as_silent
@compiled
def run(
    volts, flags, signals, tiles, counters, blocks, deviations, shared, levels, scores, sections,
    members, bounds, place, only_mean, numbers, keep_envelope, keep_level,
):  # fmt: skip
    """Run all stages over all rows, from ``volts`` to ``flags`` and ``signals``.

    Each argument costs a call some 50 ns.
    """
    settings = _settings(numbers)
    n_channels, n_groups = volts.shape[1], bounds.size - 1
    channels = 1 + 2 * n_groups  # first column of the channels' decisions, and of their validity
    valid = channels + n_channels
    n_tiles, lanes = tiles.shape[0], tiles.shape[2]
    block, power = blocks[0], blocks[1]
    low, high, flat_rows = settings.low_v, settings.high_v, settings.flat_rows
    threshold, vote = settings.threshold, int(settings.vote)
    common_mode, full_wave = int(settings.common_mode), settings.full_wave != 0.0
    exponent = int(settings.exponent)
    envelope_rows, level_rows = int(settings.envelope_rows), int(settings.level_rows)
    envelope_tail = FIXED_SLOTS + 2 * sections.shape[0]
    level_tail = envelope_tail + envelope_rows + 1
    for start in range(0, volts.shape[0], BLOCK_ROWS):
        rows = min(BLOCK_ROWS, volts.shape[0] - start)
        if common_mode != NO_COMMON_MODE:
            for t in range(n_tiles):
                a, b = t * lanes, min((t + 1) * lanes, n_channels)
                _check_samples(
                    volts, start, rows, a, b, low, high, flat_rows, tiles[t], flags, valid
                )
            _common_mode(
                volts, start, rows, low, high, common_mode, tiles, flags, valid, counters,
                deviations, shared,
            )  # fmt: skip
        envelope_row, level_row = int(counters[ENVELOPE_ROW]), int(counters[LEVEL_ROW])
        at_envelope, at_level = envelope_row, level_row
        for t in range(n_tiles):
            a, b = t * lanes, min((t + 1) * lanes, n_channels)
            tile = tiles[t]
            if common_mode == NO_COMMON_MODE:
                _check_samples(volts, start, rows, a, b, low, high, flat_rows, tile, flags, valid)
            _load(volts, start, rows, a, b, low, high, shared, tile, block)
            _filter(block, rows, sections, tile[FIXED_SLOTS:envelope_tail])
            _rectified_power(block, power, rows, full_wave, exponent)
            at_envelope = _window_means(
                power, rows, envelope_rows, envelope_row, tile[ENVELOPE_HEAD],
                tile[envelope_tail:level_tail], True,
            )  # fmt: skip
            if keep_envelope:
                _keep(power, rows, signals, start, a, b)
            at_level = _window_means(
                power, rows, level_rows, level_row, tile[LEVEL_HEAD], tile[level_tail:], False
            )
            for k in range(rows):
                p, on = power[k], flags[start + k][channels + a : channels + b]
                for i in range(on.size):
                    on[i] = p[i] > threshold
            if keep_level:
                left = n_channels if keep_envelope else 0
                _keep(power, rows, signals, start, left + a, left + b)
            if vote == VOTE_MEAN:
                _show_levels(power, rows, place[a:b], flags, start, valid + a, levels)
        counters[ENVELOPE_ROW], counters[LEVEL_ROW] = at_envelope, at_level
        if vote == VOTE_MEAN:
            _mean_votes(levels, rows, bounds, only_mean, scores)
        _vote(start, rows, members, bounds, vote, threshold, scores, flags, channels, valid)


@as_silent
@compiled
def statistics_of_votes(level, flags, place, bounds, votes, levels, statistics):
    """Write the largest number of the groups in each row, by vote.

    Parameters
    ----------
    level
        Shape (n, c).
    flags
        Their last c columns tell which levels are valid.
    place
        Each channel's place among the members of the groups, one group after the other.
    bounds
        Where each group begins and ends there.
    votes
        As numbers.
    levels
        Room to work in, shape (c, VOTE_ROWS).
    statistics
        Shape (votes, n or more in whole vectors).
    """
    valid = flags.shape[1] - level.shape[1]
    statistics[:] = 0.0
    for start in range(0, level.shape[0], VOTE_ROWS):
        rows = min(VOTE_ROWS, level.shape[0] - start)
        for i in range(place.size):
            room = levels[place[i]]
            for k in range(rows):
                room[k] = level_of_voter(level[start + k, i], flags[start + k, valid + i])
        for g in range(bounds.size - 1):
            room = levels[bounds[g] : bounds[g + 1]]
            raise_to_votes(room, room.shape[0], rows, votes, statistics[:, start:])
