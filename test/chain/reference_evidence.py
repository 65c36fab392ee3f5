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

"""The decision by evidence of the reference, a row at a time.

Part of :mod:`chain.reference`, written as plainly. Each function is one equation, so that each
can be held against what the chain gives for it. Arrays have the shape (n, c), but for rows of an
impact, (n,).
"""

import numpy as np

#: The floor is the quantile below which a tenth of a channel's rest lies.
QUANTILE = 0.1
LEAST_EXCESS_DB = -8.7


def mains_rows(mains_hz, sample_rate_hz):
    """Return the fewest rows that hold whole periods of the mains, to a thousandth of one."""
    if mains_hz == 0:
        return 0
    for rows in range(1, int(0.25 * sample_rate_hz) + 1):
        periods = rows * mains_hz / sample_rate_hz
        if round(periods) >= 1 and abs(periods - round(periods)) <= 1e-3:
            return rows
    raise ValueError(f'no whole periods of {mains_hz} Hz')


def take_off_mains(x, ok, rows):
    """Subtract from each row the one `rows` before; 0 in the first rows of a channel."""
    if rows == 0:
        return x
    y = np.where(np.isnan(x), x, 0.0)
    for column in range(x.shape[1]):
        for row in np.flatnonzero(ok[:, column])[:1]:
            later = x[row + rows :, column]
            y[row + rows :, column] = later - x[row : row + len(later), column]
    return y


def after_impact(volts, ok, enabled, config, step_rows, hold_rows):
    """Return the rows that an impact is held for, its own included.

    In an impact ``impact_channels`` enabled channels step by more than ``impact_v`` from their
    last good sample ``step_rows`` rows ago.
    """
    n_rows, n_channels = volts.shape
    held = np.zeros(n_rows, dtype=bool)
    lasts = np.full((n_rows + step_rows, n_channels), np.nan)  # from step_rows before the first
    for row in range(n_rows):
        steps = 0
        lasts[row + step_rows] = lasts[row + step_rows - 1]
        for column in np.flatnonzero(ok[row] & enabled):
            # A comparison with NaN, where there is no last sample yet, is false.
            steps += abs(volts[row, column] - lasts[row, column]) > config.impact_v
            lasts[row + step_rows, column] = volts[row, column]
        if config.impact_v > 0 and steps >= config.impact_channels:
            held[row : row + hold_rows] = True
    return held


def rows_in_contact(low, valid, config, hold_rows):
    """Return the rows in contact, ``hold_rows`` from each touch on, and those of a touch.

    In a touch, ``contact_channels`` valid channels have a low level above ``contact_level_v``;
    while there is contact, 2 dB less is enough.
    """
    contact = np.ones(len(low), dtype=bool)
    touches = contact.copy()
    if low_band(config) is None or config.contact_level_v == 0:
        return contact, touches
    touched = -np.inf
    for row in range(len(low)):
        in_contact = row - touched < hold_rows
        wanted_v = config.contact_level_v * (10 ** (-2 / 20) if in_contact else 1)
        if np.count_nonzero(low[row, valid[row]] > wanted_v) >= config.contact_channels:
            touched = row
        touches[row] = row == touched
        contact[row] = row - touched < hold_rows
    return contact, touches


def low_band(config):
    """Return the band of the low level, None where neither contact nor activity is looked at."""
    looked_at = config.contact_level_v > 0 or config.activity_cap_db > 0
    return config.activity_band_hz if looked_at else None


def least_floors_db(config):
    """Return the least floor of each channel, NaN where none is given.

    Where the number of given ones is not that of the channels, all have the first.
    """
    given = list(config.noise_floor) or [np.nan]
    if len(given) != config.channels:
        given = given[:1] * config.channels
    return decibels(np.array(given))


def rows_that_move(volts, ok, envelope, config):
    """Return in which rows a channel tells of its noise.

    Those are all with a good sample where floors are given, else those whose good sample is not
    the last good one, and whose envelope is not 0.
    """
    moves = ok.copy()
    if config.noise_floor:
        return moves
    for column in range(volts.shape[1]):
        rows = np.flatnonzero(ok[:, column])
        moves[rows, column] = np.diff(volts[rows, column], prepend=volts[rows[:1], column]) != 0
    return moves & (envelope > 0)


def rows_that_settled(moves, valid, settle_rows):
    """Return where a channel is valid, and first moved at least ``settle_rows`` rows before."""
    settled = np.zeros(valid.shape, dtype=bool)
    for column in range(valid.shape[1]):
        for first in np.flatnonzero(moves[:, column])[:1]:
            settled[first + settle_rows :, column] = valid[first + settle_rows :, column]
    return settled


def rows_with_floor(moving, config):
    """Return where a channel has a floor: a learnt one always, another once it has moved."""
    learnt = config.noise_floor_learnt and len(config.noise_floor) > 0
    return learnt | (np.cumsum(moving, axis=0) > 0)


def decibels(envelope):
    """Return 20 log10 of an envelope; minus infinity for 0."""
    with np.errstate(divide='ignore'):
        return 20 * np.log10(envelope)


def moved_floor(floor_db, level_db, config):
    """Move floors by one row towards the quantile of the level."""
    per_row = config.noise_floor_rate_db_s / (QUANTILE * config.sample_rate_hz)
    return np.where(
        level_db > floor_db, floor_db + per_row * QUANTILE, floor_db - per_row * (1 - QUANTILE)
    )


def lifted_floors(floors_db, low, moves, config):
    """Return the floors that count: where floors move, they follow the low level.

    That is a number of volts; what the gain and the exponent make of volts makes it comparable.
    """
    as_envelope_db = config.exponent * (decibels(low) + 20 * np.log10(config.gain))
    lifted = np.clip(
        as_envelope_db - config.activity_range_db, floors_db, floors_db + config.activity_cap_db
    )
    return np.where(moves, lifted, floors_db)


def common_excess(level_db, bare_floors_db, begun, settled, rank):
    """Return what even the channel of a rank, from the quietest on, is above its floor, in dB.

    A channel that has settled but has no floor yet is not above it.
    """
    common = np.zeros(len(level_db))
    over_db = np.where(begun, level_db - bare_floors_db, 0.0)
    for row in range(len(level_db)):
        over = np.sort(over_db[row, settled[row]])
        if 0 < rank < len(over):
            common[row] = max(over[rank - 1], 0.0)
    return common


def excess_of(level_db, floors_db, common_db, counts, held, cap_db):
    """Return how far levels count above their floors and the common excess, in dB."""
    excess = np.clip(level_db - floors_db - common_db[:, None], LEAST_EXCESS_DB, cap_db)
    excess[~counts] = 0.0
    excess[held] = 0.0
    return excess


def evidence_of(excess_db, counts, config):
    """Sum the excess beyond an offset, from 0 to a limit, in dB s."""
    evidence = np.zeros(excess_db.shape)
    g = np.zeros(excess_db.shape[1])
    for row in range(excess_db.shape[0]):
        gain = (excess_db[row] - config.evidence_offset_db) / config.sample_rate_hz
        g = np.where(counts[row], np.clip(g + gain, 0.0, config.evidence_limit_db_s), g)
        evidence[row] = g
    return evidence


def channels_on(evidence, threshold):
    """Return where channels are ON: from above the threshold on until not above half of it."""
    on = np.zeros(evidence.shape, dtype=bool)
    before = np.zeros(evidence.shape[1], dtype=bool)
    for row in range(evidence.shape[0]):
        g = evidence[row]
        before = (g > threshold) | (before & (g > threshold / 2))
        on[row] = before
    return on


def largest_threshold(evidence):
    """Return below which threshold a channel is ON.

    It is ON where the evidence was above the threshold in some row, and has been above half of it
    ever since.
    """
    largest = np.zeros(evidence.shape)
    for row in range(evidence.shape[0]):
        came_on = evidence[row::-1]  # from this row backwards
        since = np.minimum.accumulate(came_on, axis=0)
        largest[row] = np.minimum(came_on, 2 * since).max(axis=0)
    return largest
