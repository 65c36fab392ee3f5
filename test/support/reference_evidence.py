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

Part of :mod:`support.reference`, written as plainly. Each function is one equation, so that each
can be held against what the chain gives for it. Arrays have the shape (n, c), but for rows of an
impact, (n,).
"""

from types import SimpleNamespace

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
            y[row + rows :, column] = x[row + rows :, column] - x[row : len(x) - rows, column]
    return y


def after_impact(volts, ok, enabled, impact_v, impact_channels, hold_rows):
    """Return the rows that an impact is held for, its own included.

    In an impact this many enabled channels step by more than ``impact_v`` between their samples.
    """
    n_rows, n_channels = volts.shape
    held = np.zeros(n_rows, dtype=bool)
    last = np.full(n_channels, np.nan)
    for row in range(n_rows):
        steps = 0
        for column in np.flatnonzero(ok[row] & enabled):
            # A comparison with NaN, where there is no last sample yet, is false.
            steps += abs(volts[row, column] - last[column]) > impact_v
            last[column] = volts[row, column]
        if impact_v > 0 and steps >= impact_channels:
            held[row : row + hold_rows] = True
    return held


def rows_that_count(ok, valid, settle_rows):
    """Return where a channel's envelope is meaningful.

    There the channel is valid, and its first good sample is at least ``settle_rows`` back.
    """
    counts = np.zeros(valid.shape, dtype=bool)
    for column in range(valid.shape[1]):
        for first in np.flatnonzero(ok[:, column])[:1]:
            counts[first + settle_rows :, column] = valid[first + settle_rows :, column]
    return counts


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


def floors_of(level_db, counts, config):
    """Follow the noise floor of each channel, in dB; the least before the first row that counts.

    A learnt floor begins with the least, any other with the first level.
    """
    floors = np.zeros(level_db.shape)
    least = np.broadcast_to(np.asarray(config.noise_floor, dtype=float), level_db.shape[1:])
    floor_db = least_db = 20 * np.log10(least)
    begun = np.full(least.shape, config.noise_floor_learnt)
    for row in range(level_db.shape[0]):
        moved = np.where(begun, moved_floor(floor_db, level_db[row], config), level_db[row])
        moved = np.clip(moved, least_db, least_db + config.noise_floor_range_db)
        floor_db = np.where(counts[row], moved, floor_db)
        begun = begun | counts[row]
        floors[row] = floor_db
    return floors


def excess_of(level_db, floors_db, counts, held, cap_db):
    """Return how far levels count above their floors, in dB."""
    excess = np.clip(level_db - floors_db, LEAST_EXCESS_DB, cap_db)
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


def decide_by_evidence(volts, ok, valid, enabled, envelope, settle_rows, hold_rows, config):
    """Decide on each channel by the evidence for slip.

    Returns
    -------
    types.SimpleNamespace
        level (the evidence), floor, excess, held (what is held against a threshold), channels
        (n, c); after_impact (n,).
    """
    blanked = after_impact(volts, ok, enabled, config.impact_v, config.impact_channels, hold_rows)
    counts = rows_that_count(ok, valid, settle_rows)
    level_db = decibels(envelope)
    floors = floors_of(level_db, counts, config)
    excess = excess_of(level_db, floors, counts, blanked, config.evidence_cap_db)
    evidence = evidence_of(excess, counts, config)
    return SimpleNamespace(
        level=evidence,
        floor=floors,
        excess=excess,
        held=largest_threshold(evidence),
        channels=channels_on(evidence, config.threshold),
        after_impact=blanked,
    )
