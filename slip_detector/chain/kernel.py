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
same bits. The kernel processes channels in tiles of sixteen (:data:`.LANES`) and rows in blocks of
at most 64, so that the data of a block stay in the first-level cache. No result of a row depends
on where a block or a call begins, so any cut of the rows gives the same bits.
"""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain import stages, votes
from slip_detector.chain.samples import Floats, Ints
from slip_detector.chain.stages import FIRST_ROW, NO_ROW, WORD_ROWS
from slip_detector.chain.votes import NO_COMMON_MODE, VOTE_MEAN, vote_numbers
from slip_detector.compiled import (
    LANES,
    compiled_for,
    compiled_in_place,
    compiled_within,
    load,
    spread,
    store,
)
from slip_detector.parameters.detector import COMMON_MODES, ChainConfig

Words = NDArray[np.uint64]

#: Rows whose samples are checked before the other stages begin, as that fetches them into caches.
CHUNK_ROWS = 8 * WORD_ROWS

#: In place of the first column of a signal that is not wanted: below 0 for every tile.
NOT_KEPT = -(2**62)

#: The parameters as the kernel reads them: numbers, first those that are whole. Without mains,
#: impacts, evidence, contact, activity or common excess that of ``mains_rows``, ``impact_v``,
#: ``evidence``, ``contact_channels``, ``activity_cap_db`` or ``common_rank`` is 0.
WHOLE = (
    'channels', 'common_mode', 'full_wave', 'exponent', 'vote', 'envelope_rows', 'level_rows',
    'mains_rows', 'evidence', 'impact_channels', 'impact_rows', 'hold_rows', 'contact_channels',
    'contact_rows', 'common_rank',
)  # fmt: skip
REAL = (
    'flat_rows', 'threshold', 'noise_floor_range_db', 'floor_up_db', 'floor_down_db',
    'evidence_cap_db', 'evidence_offset_db', 'evidence_limit_db_s', 'period_s', 'impact_v',
    'contact_v2', 'activity_factor', 'activity_shift_db', 'activity_cap_db',
)  # fmt: skip
SETTINGS = np.dtype(
    (np.record, [(name, np.int64) for name in WHOLE] + [(name, np.float64) for name in REAL])
)


class Plan(NamedTuple):
    """All inputs of the kernel except samples and state, and its working memory.

    There are t tiles of c columns, g groups and v votes whose statistic is wanted. The working
    memory is that of one block of rows of all columns; it has b blocks of tiles: all, if those
    wait for the contact or the common excess of all channels, else one.

    Attributes
    ----------
    settings : ndarray of :data:`SETTINGS`, shape (1,)
    limits : ndarray, shape (t, 3, 16)
        Lowest and highest good sample, and least noise floor in dB, of each column.
    sections, low_sections : ndarray, shape (s, 6)
        The filters, and those of the low level, if it is needed.
    active : ndarray of int
        The tiles with an enabled channel.
    members, bounds : ndarray of int
        Columns of the enabled channels of all groups, and where those of each group begin and end.
    votes : ndarray of int, shape (v,)
        The votes whose statistic is wanted.
    blocks, low : ndarray, shape (b, 64, 16)
        Rows of a tile, which the stages replace in place, and what activity asks of their floors.
    common_v, common_db : ndarray, shape (64,)
        Common mode and common excess of each row.
    words : ndarray of words, shape (8, 5, c)
        The words of each channel, in the order of :mod:`.stages`, in the blocks of a chunk.
    decisions : ndarray of words, shape (columns of flags, at least 16)
        The flags, as words.
    digits : ndarray of words
        Digits for counting channels.
    by_channel : ndarray, shape (c, 64)
        For the common mode and for the votes; empty if these do not need it.
    statistics : ndarray, shape (v or 1, 64)
        Statistic of each vote.
    """

    settings: NDArray[np.void]
    limits: Floats
    sections: Floats
    low_sections: Floats
    active: Ints
    members: Ints
    bounds: Ints
    votes: Ints
    blocks: Floats
    low: Floats
    common_v: Floats
    common_db: Floats
    words: Words
    decisions: Words
    digits: Words
    by_channel: Floats
    statistics: Floats


def tiles_of(config: ChainConfig) -> int:
    """Return the number of tiles of sixteen columns that a configuration has."""
    return -(-config.channels // LANES)


def flags_width(config: ChainConfig) -> int:
    """Return the number of columns of flags, at least those of a vector."""
    return max(1 + 2 * len(config.groups) + 2 * config.channels, LANES)


def plan_of(
    config: ChainConfig, sections: Floats, low_sections: Floats, wanted: Sequence[str | int]
) -> Plan:
    """Return the plan of a chain: its configuration, the filters' sections and wanted votes."""
    tiles, disabled = tiles_of(config), {channel - 1 for channel in config.disabled_channels}
    enabled = [channel for channel in range(config.channels) if channel not in disabled]
    # In an empty range no sample is good. The floors of columns without a channel have no effect.
    limits = np.tile([[np.inf], [-np.inf], [0.0]], tiles * LANES)
    limits[:2, enabled] = np.transpose([config.valid_range_v])
    if config.decision == 'evidence':
        limits[stages.LEAST_DB, : config.channels] = 20.0 * np.log10(config.noise_floor)
    groups = [[c - 1 for c in group if c - 1 not in disabled] for group in config.groups.values()]
    settings = _settings_of(config, low_sections)
    rank = settings['common_rank'][0]
    blocks = tiles if settings['contact_channels'][0] or rank else 1
    by_channel = bool(wanted or rank or config.vote == 'mean' or config.common_mode != 'none')
    return Plan(
        settings=settings,
        limits=np.ascontiguousarray(limits.reshape(3, tiles, LANES).swapaxes(0, 1)),
        sections=sections,
        low_sections=low_sections,
        active=np.unique(np.array(enabled, np.int64) // LANES),
        members=np.array([c for group in groups for c in group], np.int64),
        bounds=np.cumsum([0] + [len(group) for group in groups], dtype=np.int64),
        votes=vote_numbers(wanted),
        blocks=aligned((blocks, WORD_ROWS, LANES)),
        low=aligned((blocks, WORD_ROWS, LANES)),
        common_v=np.zeros(WORD_ROWS),
        common_db=np.zeros(WORD_ROWS),
        words=np.zeros((CHUNK_ROWS // WORD_ROWS, 5, tiles * LANES), np.uint64),
        decisions=np.zeros(flags_width(config), np.uint64),
        digits=np.zeros(votes.DIGITS, np.uint64),
        by_channel=np.zeros((tiles * LANES * by_channel, WORD_ROWS)),
        statistics=np.zeros((max(len(wanted), 1), WORD_ROWS)),
    )


def _settings_of(config: ChainConfig, low_sections: Floats) -> NDArray[np.void]:
    evidence = config.decision == 'evidence'
    low = len(config.low_band_hz) > 0
    # The kernel leaves the gain of the low band and the mean of its window to what uses them.
    low_gain = low_sections[0, 0] / np.sqrt(config.samples(config.envelope_window_s)) if low else 1
    up_db, down_db = stages.floor_steps_db(config.noise_floor_rate_db_s, config.sample_rate_hz)
    settings = {name: getattr(config, name, None) for name in (*WHOLE, *REAL)} | {
        'flat_rows': config.samples(config.flat_after_s) if config.flat_after_s else np.inf,
        'common_mode': COMMON_MODES.index(config.common_mode),
        'full_wave': config.rectify == 'full',
        'vote': vote_numbers([config.vote])[0],
        'envelope_rows': config.samples(config.envelope_window_s),
        'level_rows': config.samples(config.decision_window_s),
        'evidence': evidence,
        'floor_up_db': up_db,
        'floor_down_db': down_db,
        'period_s': 1.0 / config.sample_rate_hz,
        'impact_v': config.impact_v if evidence else 0.0,
        'hold_rows': config.samples(config.impact_hold_s),
        'contact_channels': config.contact_channels if low and config.contact_level_v else 0,
        'contact_rows': config.samples(config.contact_hold_s),
        'common_rank': config.common_rank if evidence else 0,
        'contact_v2': (config.contact_level_v / low_gain) ** 2,
        'activity_factor': config.exponent * stages.OCTAVE_DB,
        'activity_shift_db': config.exponent * 20 * np.log10(config.gain * low_gain)
        - config.activity_range_db,
        'activity_cap_db': config.activity_cap_db if low else 0.0,
    }
    return np.array([tuple(settings.values())], SETTINGS)


def aligned(shape: tuple[int, ...]) -> Floats:
    """Return zeros that begin where a cache line does, where vectors are loaded in half the time.

    Examples
    --------
    >>> aligned((3, 16)).ctypes.data % 64
    0
    """
    size = int(np.prod(shape))
    values = np.zeros(size + 8)
    skip = -(values.ctypes.data // values.itemsize) % 8
    return values[skip : skip + size].reshape(shape)


@compiled_in_place
def _write_flags(decisions, flags, start, rows):
    """Write each word to a column of flags: one byte for each of its bits."""
    width = flags.shape[1]
    for first in range(0, width, LANES):
        i = min(first, width - LANES)
        words, row = load(decisions, (i,)), spread(FIRST_ROW)
        for k in range(start, start + rows):
            store((words & row) != NO_ROW, flags, (k, i))
            row = row + row


@compiled_within
def _run_tile(
    volts, start, rows, t, settings, part, tile, plan, words, held, contact, touch, signals, kept
):
    """Run a block of rows through one tile, up to the ON bits of its channels.

    Where something of all channels is needed, a block takes three parts: up to the envelopes, from
    the contact of all channels on, and from their common excess on. Else it takes part 0 alone.
    """
    waits = settings.contact_channels > 0 or settings.common_rank > 0
    b, limits, evidence = t if waits else 0, plan.limits[t], settings.evidence != 0
    block, low, low_sections = plan.blocks[b], plan.low[b], plan.low_sections
    at = t * LANES
    columns = (at + kept[0], at + kept[1], at + kept[2], at + kept[3])
    comb = stages.DELAYS + 2 * plan.sections.shape[0]
    envelopes = comb + settings.mains_rows + 1
    levels = envelopes + settings.envelope_rows + 3
    if part == 0:
        stages.load_deviations(block, volts, start, rows, at, limits, tile, plan.common_v)
        if low_sections.shape[0] > 0:
            stages.find_low_level(
                block, low, rows, low_sections, settings, tile, levels, words, at
            )
        if settings.mains_rows > 0:
            stages.subtract_mains(block, rows, settings.mains_rows, tile, comb)
        stages.run_filters(block, rows, plan.sections, tile, stages.DELAYS)
        stages.rectified_power(block, rows, settings.full_wave != 0, settings.exponent)
        # Evidence takes the squares of the envelope and keeps that itself.
        stages.window_means(
            block, rows, settings.envelope_rows, tile, envelopes, not evidence, signals, start,
            -1 if evidence else columns[0],
        )  # fmt: skip
    valid = load(words, (stages.VALID, at))
    if evidence and (part == 1 or not waits):
        stages.find_excess(
            block, low, rows, limits, settings, tile, valid, contact, touch, signals, start,
            columns,
        )  # fmt: skip
    if waits and part < 2:
        return
    if evidence:
        stages.sum_evidence(
            block, rows, settings, tile, held, contact, plan.common_db, signals, start, columns
        )
    else:
        stages.window_means(
            block, rows, settings.level_rows, tile, levels, False, signals, start, columns[1]
        )
    stages.rows_above(block, rows, settings.threshold, words, at)
    if settings.vote == VOTE_MEAN or plan.votes.size:
        votes.gather_levels(block, rows, valid, at, plan.by_channel)


@compiled_in_place
def run(volts, flags, signals, tiles, plan, kept):
    """Run all stages over all rows, from ``volts`` to ``flags`` and ``signals``.

    Parameters
    ----------
    volts
        Rows of volts, shape (n, columns), whole tiles of columns.
    flags
        Output of decisions, shape (n, 1 + 2 g + 2 c): slip, groups, whether each group can vote,
        channels, valid.
    signals
        Output of envelope, level, floor and excess, as far as they are wanted, each with as many
        columns as ``volts``; then the statistics of v votes (above 1: ON), one column each.
    tiles
        The state, shape (t, slots, 16).
    plan
        A :class:`Plan`.
    kept
        The first columns in ``signals`` of envelope, level, floor and excess, or ``NOT_KEPT``.
    """
    settings, column = plan.settings[0], signals.shape[1] - plan.votes.size
    held, contact, touch = NO_ROW, ~NO_ROW, ~NO_ROW
    for start in range(0, volts.shape[0], WORD_ROWS):
        rows, w = min(WORD_ROWS, volts.shape[0] - start), start % CHUNK_ROWS // WORD_ROWS
        if w == 0:
            end = min(start + CHUNK_ROWS, volts.shape[0])
            for t in plan.active:
                stages.check_samples(
                    volts, start, end, t * LANES, plan.limits[t], settings, tiles[t], plan.words
                )
        words = plan.words[w]
        valid = words[stages.VALID]
        # What needs all channels of a row is between the stages of each channel.
        if settings.impact_v > 0.0:
            held = votes.rows_of_impact(rows, settings, plan, words[stages.STEPS], tiles)
        if settings.common_mode != NO_COMMON_MODE:
            votes.find_common_mode(volts, start, rows, settings, plan, valid, tiles)
        gated, shared = settings.contact_channels > 0, settings.common_rank > 0
        for part in range(3 if gated or shared else 1):
            if part == 1 and gated:
                contact, touch = votes.rows_of_contact(rows, settings, plan, words, tiles)
            if part == 2 and shared:
                votes.find_common_excess(rows, settings, plan)
            for t in plan.active:
                _run_tile(
                    volts, start, rows, t, settings, part, tiles[t], plan, words, held, contact,
                    touch, signals, kept,
                )  # fmt: skip
        votes.decide(rows, settings, plan, words[stages.ON], valid)
        _write_flags(plan.decisions, flags, start, rows)
        if plan.votes.size:
            votes.find_statistics(
                plan.by_channel, plan.members, plan.bounds, rows, plan.votes, plan.statistics
            )
        for v in range(plan.votes.size):
            for k in range(rows):
                signals[start + k, column + v] = plan.statistics[v, k] / settings.threshold


@cache
def compiled_run():
    """Return :func:`run` for calls from Python; the first call compiles or loads it.

    The types of its arguments are not checked.
    """
    plan = plan_of(ChainConfig(), np.zeros((1, 6)), np.zeros((0, 6)), ())
    rows = np.zeros((0, LANES))
    return compiled_for(run, rows, rows != 0.0, rows, np.zeros((1, 1, LANES)), plan, (0,) * 4)
