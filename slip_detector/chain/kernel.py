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

Numba compiles it; without Numba the same functions run interpreted, with the same bits. The
kernel processes channels in tiles of sixteen (:data:`.LANES`) and rows in blocks of at most 64, so
that the data of a block stay in the first-level cache. No result of a row depends on where a block
or a call begins, so any cut of the rows gives the same bits.
"""

import dataclasses
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain import decibels, evidence, stages, votes
from slip_detector.chain.layout import flag_layout, state_layout, tiles_of
from slip_detector.chain.samples import Floats, Ints
from slip_detector.chain.stages import FIRST_ROW, NO_ROW, WORD_ROWS
from slip_detector.chain.votes import NO_COMMON_MODE, VOTE_MEAN, vote_numbers
from slip_detector.compiled import compiled_for, compiled_in_place, compiled_within
from slip_detector.parameters import COMMON_MODES, ChainConfig
from slip_detector.vectors import LANES, load, spread, store

Words = NDArray[np.uint64]

#: Rows whose samples are checked before the other stages begin: the check fetches them into
#: caches.
CHUNK_ROWS = 8 * WORD_ROWS


class Plan(NamedTuple):
    """All inputs of the kernel except samples and state, and its working memory.

    There are t tiles of c columns, g groups and v votes whose statistic is wanted. The working
    memory is for one block of rows.

    Attributes
    ----------
    settings : ndarray of records, shape (1,)
        The parameters, as numbers.
    limits : ndarray, shape (t, 3, 16)
        Lowest and highest good sample, and least noise floor in dB (NaN: none), of each column.
    sections, low_sections : ndarray, shape (s, 6)
        The filters, and those of the low level, if it is needed.
    active : ndarray of int
        The tiles with an enabled channel.
    members, bounds : ndarray of int
        Columns of the enabled channels of all groups, and where those of each group begin and end.
    votes : ndarray of int, shape (v,)
        The votes whose statistic is wanted.
    blocks, low : ndarray, shape (t, 64, 16)
        Rows of a tile, which the stages replace in place, and the floors by activity, in dB.
    common_v, common_db : ndarray, shape (64,)
        Common mode and common excess of each row.
    words : ndarray of words, shape (8, 6, c)
        The words of each channel, in the order of :mod:`.stages`, in the blocks of a chunk.
    decisions : ndarray of words, shape (columns of flags, at least 16)
        The flags, as words.
    digits : ndarray of words
        Digits for counting channels.
    by_channel : ndarray, shape (c, 64)
        Rows of each channel for common mode and votes; empty if these do not need them.
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


def plan_of(
    config: ChainConfig, sections: Floats, low_sections: Floats, wanted: Sequence[str | int]
) -> Plan:
    """Return the plan of a chain: its configuration, the filters' sections and wanted votes."""
    tiles = tiles_of(config.channels)
    disabled = {channel - 1 for channel in config.disabled_channels}
    enabled = [channel for channel in range(config.channels) if channel not in disabled]
    # In an empty range no sample is good. The floors of columns without a channel have no effect.
    limits = np.tile([[np.inf], [-np.inf], [0.0]], tiles * LANES)
    limits[:2, enabled] = np.transpose([config.valid_range_v])
    if config.decision == 'evidence':
        limits[stages.LEAST_DB, : config.channels] = 20.0 * np.log10(config.floors or np.nan)
    groups = [[c - 1 for c in group if c - 1 not in disabled] for group in config.groups.values()]
    settings = _settings_of(config, sections, low_sections)
    rank = settings['common_rank'][0]
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
        blocks=aligned((tiles, WORD_ROWS, LANES)),
        low=aligned((tiles, WORD_ROWS, LANES)),
        common_v=np.zeros(WORD_ROWS),
        common_db=np.zeros(WORD_ROWS),
        words=np.zeros((CHUNK_ROWS // WORD_ROWS, 6, tiles * LANES), np.uint64),
        decisions=np.zeros(max(settings['flags'][0], LANES), np.uint64),
        digits=np.zeros(votes.DIGITS, np.uint64),
        by_channel=aligned((tiles * LANES * by_channel, WORD_ROWS)),
        statistics=np.zeros((max(len(wanted), 1), WORD_ROWS)),
    )


def _settings_of(config: ChainConfig, sections: Floats, low_sections: Floats) -> NDArray[np.void]:
    """Return the parameters as the kernel reads them: the numbers under their names, in a record.

    ``mains_rows``, ``impact_v``, ``evidence``, ``contact_channels``, ``activity_cap_db`` and
    ``common_rank`` are 0 where the chain has no such stage. ``free_floors`` says that evidence has
    no given floors.
    """
    decides = config.decision == 'evidence'
    low = len(config.low_band_hz) > 0
    # The kernel has neither the gain of the low band nor the mean of its window.
    low_gain = low_sections[0, 0] / np.sqrt(config.samples(config.envelope_window_s)) if low else 1
    up_db, down_db = evidence.floor_steps_db(config.noise_floor_rate_db_s, config.sample_rate_hz)
    # By the types of the fields: the record is the same for every configuration.
    fields = dataclasses.fields(ChainConfig)
    whole: dict[str, Any] = {f.name: getattr(config, f.name) for f in fields if f.type is int}
    real: dict[str, Any] = {f.name: getattr(config, f.name) for f in fields if f.type is float}
    whole |= {
        'mains_rows': config.mains_rows,
        'impact_rows': config.impact_rows,
        'common_mode': COMMON_MODES.index(config.common_mode),
        'full_wave': config.rectify == 'full',
        'vote': vote_numbers([config.vote])[0],
        'envelope_rows': config.samples(config.envelope_window_s),
        'level_rows': config.samples(config.decision_window_s),
        'evidence': decides,
        'free_floors': decides and not config.floors,
        'hold_rows': config.samples(config.impact_hold_s),
        'contact_channels': config.contact_channels if low and config.contact_level_v else 0,
        'contact_rows': config.samples(config.contact_hold_s),
        'common_rank': config.common_rank if decides else 0,
        **state_layout(config, len(sections), len(low_sections)),
        **flag_layout(config)._asdict(),
    }
    real |= {
        'flat_rows': config.samples(config.flat_after_s) if config.flat_after_s else np.inf,
        'floor_up_db': up_db,
        'floor_down_db': down_db,
        'period_s': 1.0 / config.sample_rate_hz,
        'impact_v': config.impact_v if decides else 0.0,
        'contact_v2': (config.contact_level_v / low_gain) ** 2,
        'activity_factor': config.exponent * decibels.OCTAVE_DB,
        'activity_shift_db': config.exponent * 20 * np.log10(config.gain * low_gain)
        - config.activity_range_db,
        'activity_cap_db': config.activity_cap_db if low else 0.0,
    }
    types = [(name, np.int64) for name in whole] + [(name, np.float64) for name in real]
    return np.array([(*whole.values(), *real.values())], np.dtype((np.record, types)))


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
def _find_envelopes(volts, start, rows, at, block, low, plan, tile, words, out):
    """Run a block of rows through one tile, from samples to envelopes, of evidence the squares."""
    settings = plan.settings[0]
    limits = plan.limits[at // LANES]
    stages.load_deviations(block, volts, start, rows, at, limits, tile, plan.common_v)
    if plan.low_sections.shape[0] > 0:
        evidence.find_low_level(block, low, rows, plan.low_sections, settings, tile, words, at)
    if settings.mains_rows > 0:
        stages.subtract_mains(block, rows, settings, tile)
    stages.run_filters(block, rows, plan.sections, tile, settings.delay_slot)
    stages.rectified_power(block, rows, settings.full_wave != 0, settings.exponent)
    window, slot, root = settings.envelope_rows, settings.envelope_slot, settings.evidence == 0
    stages.window_means(block, start, rows, at, window, tile, slot, root, stages.ENVELOPE, out)


@compiled_within
def _find_decisions(block, start, rows, at, plan, tile, words, held, contact, out):
    """Run a block of rows through one tile, from envelopes or excess to the ON bits."""
    settings = plan.settings[0]
    if settings.evidence != 0:
        evidence.sum_evidence(block, start, rows, at, plan, tile, held, contact, out)
    else:
        window, slot = settings.level_rows, settings.level_slot
        stages.window_means(block, start, rows, at, window, tile, slot, False, stages.LEVEL, out)
    stages.rows_above(block, rows, settings.threshold, words, at)
    if settings.vote == VOTE_MEAN or plan.votes.size:
        votes.gather_levels(block, rows, load(words, (stages.VALID, at)), at, plan.by_channel)


@compiled_in_place
def run(volts, flags, signals, tiles, plan, wanted):
    """Run all stages over all rows, from ``volts`` to ``flags`` and ``signals``.

    Parameters
    ----------
    volts
        Rows of volts, shape (n, columns), whole tiles of columns.
    flags
        Output of decisions, shape (n, at least 16), see :class:`.FlagLayout`.
    signals
        Output of those of envelope, level, floor and excess that are wanted, each with as many
        columns as ``volts``; then the statistics of v votes (above 1: ON), one column each.
    tiles
        The state, shape (t, slots, 16).
    plan
        A :class:`Plan`.
    wanted
        Which of envelope, level, floor and excess are wanted.
    """
    settings, width = plan.settings[0], volts.shape[1]
    level_at = width * wanted[stages.ENVELOPE]
    floor_at = level_at + width * wanted[stages.LEVEL]
    excess_at = floor_at + width * wanted[stages.EFFECTIVE]
    statistics_at = excess_at + width * wanted[stages.EXCESS]
    out = stages.Output(signals, wanted, (0, level_at, floor_at, excess_at))
    gated, shared = settings.contact_channels > 0, settings.common_rank > 0
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
        if settings.impact_v > 0.0:
            held = votes.rows_of_impact(rows, settings, plan, words[stages.STEPS], tiles)
        if settings.common_mode != NO_COMMON_MODE:
            votes.find_common_mode(volts, start, rows, settings, plan, valid, tiles)
        for t in plan.active:
            block, low, tile = plan.blocks[t], plan.low[t], tiles[t]
            _find_envelopes(volts, start, rows, t * LANES, block, low, plan, tile, words, out)
        if gated:
            contact, touch = votes.rows_of_contact(rows, settings, plan, words, tiles)
        if settings.evidence != 0:
            for t in plan.active:
                block, low, at = plan.blocks[t], plan.low[t], t * LANES
                evidence.find_excess(
                    block, low, start, rows, at, plan, tiles[t], words, contact, touch, out
                )
        if shared:
            votes.find_common_excess(rows, settings, plan)
        for t in plan.active:
            block, at = plan.blocks[t], t * LANES
            _find_decisions(block, start, rows, at, plan, tiles[t], words, held, contact, out)
        votes.decide(rows, settings, plan, words[stages.ON], valid)
        _write_flags(plan.decisions, flags, start, rows)
        if plan.votes.size:
            votes.find_statistics(
                plan.by_channel, plan.members, plan.bounds, rows, plan.votes, plan.statistics
            )
        for v in range(plan.votes.size):
            for k in range(rows):
                signals[start + k, statistics_at + v] = plan.statistics[v, k] / settings.threshold


@cache
def compiled_run():
    """Return :func:`run` for calls from Python; the first call compiles or loads it.

    The types of its arguments are not checked.
    """
    plan = plan_of(ChainConfig(), np.zeros((1, 6)), np.zeros((0, 6)), ())
    rows = np.zeros((0, LANES))
    return compiled_for(run, rows, rows != 0.0, rows, np.zeros((1, 1, LANES)), plan, (True,) * 4)
