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
can be held against what the chain gives for it.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

#: The floor is the quantile below which a tenth of a channel's rest lies.
QUANTILE = 0.1
LEAST_EXCESS_DB = -8.7


def mains_rows(mains_hz: float, sample_rate_hz: float) -> int:
    """Return the fewest rows that hold whole periods of the mains, to a thousandth of one.

    Parameters
    ----------
    mains_hz : float
        0: no mains, no rows.
    sample_rate_hz : float
        Rows per second.

    Raises
    ------
    ValueError
        If there are none within 0.25 s.
    """
    if mains_hz == 0:
        return 0
    for rows in range(1, int(0.25 * sample_rate_hz) + 1):
        periods = rows * mains_hz / sample_rate_hz
        if round(periods) >= 1 and abs(periods - round(periods)) <= 1e-3:
            return rows
    raise ValueError(f'no whole periods of {mains_hz} Hz')


def take_off_mains(x: np.ndarray, ok: np.ndarray, rows: int) -> np.ndarray:
    """Subtract from each row the one `rows` before; 0 in the first rows of a channel.

    Parameters
    ----------
    x : numpy.ndarray
        Input of the filters, shape (n, c).
    ok : numpy.ndarray
        Which samples are credible, shape (n, c).
    rows : int
        0: nothing is taken off.

    Returns
    -------
    numpy.ndarray
        Shape (n, c).
    """
    if rows == 0:
        return x
    y = np.where(np.isnan(x), x, 0.0)
    for column in range(x.shape[1]):
        for row in np.flatnonzero(ok[:, column])[:1]:
            y[row + rows :, column] = x[row + rows :, column] - x[row : len(x) - rows, column]
    return y


def after_impact(
    volts: np.ndarray,
    ok: np.ndarray,
    enabled: np.ndarray,
    impact_v: float,
    impact_channels: int,
    hold_rows: int,
) -> np.ndarray:
    """Return the rows that an impact is held for, shape (n,).

    Parameters
    ----------
    volts, ok : numpy.ndarray
        Samples, and which of them are credible, shape (n, c).
    enabled : numpy.ndarray
        Which channels take part, shape (c,).
    impact_v : float
        A larger step between samples belongs to an impact; 0: no impacts.
    impact_channels : int
        Number of channels that must step at once.
    hold_rows : int
        Number of rows for which an impact is held, its own included.
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


def rows_that_count(ok: np.ndarray, valid: np.ndarray, settle_rows: int) -> np.ndarray:
    """Return where a channel's envelope is meaningful, shape (n, c).

    There the channel is valid, and its first good sample is at least ``settle_rows`` back.
    """
    counts = np.zeros(valid.shape, dtype=bool)
    for column in range(valid.shape[1]):
        for first in np.flatnonzero(ok[:, column])[:1]:
            counts[first + settle_rows :, column] = valid[first + settle_rows :, column]
    return counts


def decibels(envelope: np.ndarray) -> np.ndarray:
    """Return 20 log10 of an envelope; minus infinity for 0."""
    with np.errstate(divide='ignore'):
        return 20 * np.log10(envelope)


def moved_floor(
    floor_db: np.ndarray, level_db: np.ndarray, rate_db_s: float, sample_rate_hz: float
) -> np.ndarray:
    """Move floors by one row towards the quantile of the level."""
    per_row = rate_db_s / (QUANTILE * sample_rate_hz)
    return np.where(
        level_db > floor_db, floor_db + per_row * QUANTILE, floor_db - per_row * (1 - QUANTILE)
    )


def floors_of(
    level_db: np.ndarray,
    counts: np.ndarray,
    least: np.ndarray,
    learnt: bool,
    range_db: float,
    rate_db_s: float,
    sample_rate_hz: float,
) -> np.ndarray:
    """Follow the noise floor of each channel.

    Parameters
    ----------
    level_db, counts : numpy.ndarray
        Envelope in dB and whether it counts, shape (n, c).
    least : numpy.ndarray
        Least floors in the envelope's unit, shape (c,).
    learnt : bool
        Whether floors begin with the least; else with the first level.
    range_db : float
        How far they may rise.
    rate_db_s : float
        How fast they rise.
    sample_rate_hz : float
        Rows per second.

    Returns
    -------
    numpy.ndarray
        Floors in dB, shape (n, c); the least before the first row that counts.
    """
    floors = np.zeros(level_db.shape)
    least_db = 20 * np.log10(least)
    floor_db = least_db
    begun = np.full(least.shape, learnt)
    for row in range(level_db.shape[0]):
        moved = moved_floor(floor_db, level_db[row], rate_db_s, sample_rate_hz)
        moved = np.where(begun, moved, level_db[row])
        moved = np.clip(moved, least_db, least_db + range_db)
        floor_db = np.where(counts[row], moved, floor_db)
        begun = begun | counts[row]
        floors[row] = floor_db
    return floors


def excess_of(
    level_db: np.ndarray,
    floors_db: np.ndarray,
    counts: np.ndarray,
    held: np.ndarray,
    cap_db: float,
) -> np.ndarray:
    """Return how far levels count above their floors, in dB, shape (n, c)."""
    excess = np.clip(level_db - floors_db, LEAST_EXCESS_DB, cap_db)
    excess[~counts] = 0.0
    excess[held] = 0.0
    return excess


def evidence_of(
    excess_db: np.ndarray,
    counts: np.ndarray,
    offset_db: float,
    limit_db_s: float,
    sample_rate_hz: float,
) -> np.ndarray:
    """Sum the excess beyond an offset, from 0 to a limit; shape (n, c), in dB s."""
    evidence = np.zeros(excess_db.shape)
    g = np.zeros(excess_db.shape[1])
    for row in range(excess_db.shape[0]):
        summed = np.clip(g + (excess_db[row] - offset_db) / sample_rate_hz, 0.0, limit_db_s)
        g = np.where(counts[row], summed, g)
        evidence[row] = g
    return evidence


def channels_on(evidence: np.ndarray, threshold: float) -> np.ndarray:
    """Return where channels are ON: from above the threshold on until not above half of it."""
    on = np.zeros(evidence.shape, dtype=bool)
    before = np.zeros(evidence.shape[1], dtype=bool)
    for row in range(evidence.shape[0]):
        g = evidence[row]
        before = (g > threshold) | (before & (g > threshold / 2))
        on[row] = before
    return on


def largest_threshold(evidence: np.ndarray) -> np.ndarray:
    """Return below which threshold a channel is ON, shape (n, c).

    It is ON where the evidence was above the threshold in some row, and has been above half of it
    ever since.
    """
    largest = np.zeros(evidence.shape)
    for row in range(evidence.shape[0]):
        came_on = evidence[row::-1]  # from this row backwards
        since = np.minimum.accumulate(came_on, axis=0)
        largest[row] = np.minimum(came_on, 2 * since).max(axis=0)
    return largest


def decide_by_evidence(
    volts: np.ndarray,
    ok: np.ndarray,
    valid: np.ndarray,
    enabled: np.ndarray,
    envelope: np.ndarray,
    settle_rows: int,
    hold_rows: int,
    config: SimpleNamespace,
) -> SimpleNamespace:
    """Decide on each channel by the evidence for slip.

    Parameters
    ----------
    volts, ok, valid : numpy.ndarray
        Samples, which are credible, which may vote; shape (n, c).
    enabled : numpy.ndarray
        Which channels take part, shape (c,).
    envelope : numpy.ndarray
        Shape (n, c).
    settle_rows : int
        Rows of a channel before its envelope is meaningful.
    hold_rows : int
        How many rows an impact is held for.
    config : types.SimpleNamespace
        The options of :func:`support.reference.reference`.

    Returns
    -------
    types.SimpleNamespace
        level (the evidence), floor, excess, held (what is held against a threshold), channels
        (n, c); after_impact (n,).
    """
    blanked = after_impact(volts, ok, enabled, config.impact_v, config.impact_channels, hold_rows)
    counts = rows_that_count(ok, valid, settle_rows)
    level_db = decibels(envelope)
    least = np.broadcast_to(np.asarray(config.noise_floor, dtype=float), volts.shape[1:])
    rate_hz = config.sample_rate_hz
    floors = floors_of(
        level_db, counts, least, config.noise_floor_learnt, config.noise_floor_range_db,
        config.noise_floor_rate_db_s, rate_hz,
    )  # fmt: skip
    excess = excess_of(level_db, floors, counts, blanked, config.evidence_cap_db)
    evidence = evidence_of(
        excess, counts, config.evidence_offset_db, config.evidence_limit_db_s, rate_hz
    )
    return SimpleNamespace(
        level=evidence,
        floor=floors,
        excess=excess,
        held=largest_threshold(evidence),
        channels=channels_on(evidence, config.threshold),
        after_impact=blanked,
    )
