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

"""The plan: all inputs of the kernel except samples and state, in one array.

A call of compiled code takes 260 ns longer with a tuple of all these arrays and numbers than with
one array. Therefore a *plan* is one array of float64, and the kernel divides it into its parts:
:class:`Settings`, then the tiles' ranges of good samples and least noise floors and the filters'
sections, then :class:`Layout` as the bits of integers, then :class:`Scratch`. Without Numba the
division would slow each call down, so there a plan is its :class:`Parts`.

A *seat* is a channel's place in the tiles: 16 x the index of its tile + its lane. A channel in two
overlapping tiles has its seat in the first; the second computes it too, with the same bits.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slip_detector.chain.common_mode import COMMON_MODE_NUMBERS, NO_COMMON_MODE
from slip_detector.chain.compiled import COMPILED, compiled_in_place
from slip_detector.chain.evidence import floor_steps_db
from slip_detector.chain.lanes import LANES, LINE, float_part, integer_part, word_part
from slip_detector.chain.stages import WORD_ROWS
from slip_detector.chain.tiles import aligned, least_floors_db, tile_bases_of
from slip_detector.chain.votes import DIGITS, VOTE_MEAN, vote_numbers
from slip_detector.parameters.detector import ChainConfig

Floats = NDArray[np.float64]

#: Words of each channel in a chunk of rows. With many channels the state is larger than the caches
#: and is fetched once per chunk.
CHUNK_WORDS = 8


class Settings(NamedTuple):
    """The parameters that the kernel reads, as numbers.

    Attributes
    ----------
    flat_rows : float
        Number of repeats of a sample that makes a channel flat; may be infinite.
    threshold : float
    common_mode : float
        ``NO_COMMON_MODE``, ``MEAN`` or ``MEDIAN``.
    full_wave : float
        0 for half-wave.
    exponent : float
    vote : float
        As :func:`slip_detector.chain.votes.vote_numbers` returns it.
    envelope_rows, level_rows : float
        Lengths of the windows; with evidence there is no window of the level.
    comb_rows : float
        Number of rows that hold whole mains periods; 0: no comb.
    evidence : float
        1 for the decision by evidence, else 0.
    floor_range_db, floor_up_db, floor_down_db : float
        How far a noise floor may rise, and how far it moves up or down per row.
    cap_db, offset_db, limit_db_s : float
        Largest excess, the offset that is subtracted from it, and the largest evidence.
    period_s : float
        Sample period.
    impact_v, impact_channels, hold_rows : float
        Definition of an impact, and its hold time; 0 V: no detection of impacts.
    channels, enabled, groups, tiles, sections, votes : float
        Numbers of these; ``votes`` counts those whose statistic is wanted.
    """

    flat_rows: float
    threshold: float
    common_mode: float
    full_wave: float
    exponent: float
    vote: float
    envelope_rows: float
    level_rows: float
    comb_rows: float
    evidence: float
    floor_range_db: float
    floor_up_db: float
    floor_down_db: float
    cap_db: float
    offset_db: float
    limit_db_s: float
    period_s: float
    impact_v: float
    impact_channels: float
    hold_rows: float
    channels: float
    enabled: float
    groups: float
    tiles: float
    sections: float
    votes: float


class Layout(NamedTuple):
    """Where the channels are: c of them, e enabled, in t tiles and g groups; and v votes.

    Attributes
    ----------
    bases : ndarray of int, shape (t,)
        First column of each tile.
    columns, seats : ndarray of int, shape (e,)
        Column and seat of each enabled channel.
    places : ndarray of int, shape (16 t,)
        Row of ``Scratch.levels`` for each seat, -1 for none; the rows are the members of all
        groups, one group after the other.
    bounds : ndarray of int, shape (g + 1,)
        Index in ``members`` at which each group begins, and the end of the last.
    members : ndarray of int, shape (e,)
        Seats of the members of all groups, one group after the other.
    flag_seats : ndarray of int, shape (c,)
        Seat of each channel; 16 t for a disabled one.
    votes : ndarray of int, shape (v,)
        The votes whose statistic is wanted.
    """

    bases: NDArray[np.int64]
    columns: NDArray[np.int64]
    seats: NDArray[np.int64]
    places: NDArray[np.int64]
    bounds: NDArray[np.int64]
    members: NDArray[np.int64]
    flag_seats: NDArray[np.int64]
    votes: NDArray[np.int64]


class Scratch(NamedTuple):
    """Working memory, overwritten by each chunk of rows.

    A chunk has w words per channel: one if levels are gathered for votes, else ``CHUNK_WORDS``.

    Attributes
    ----------
    block : ndarray, shape (64, 16)
        Rows of a tile, which the stages replace in place.
    common_v : ndarray, shape (w, 64)
        Common mode of each row.
    digits : ndarray of words, shape (DIGITS,)
        Digits for counting votes.
    on, valid : ndarray of words, shape (w, 16 t + 1)
        For each seat the rows in which the channel is ON, or valid; the last seat stands for
        disabled channels and has no rows.
    steps : ndarray of words, shape (16 t,)
        For each seat the rows in which the channel steps; empty without detection of impacts.
    held : ndarray of words, shape (w,)
        Rows within the hold time of an impact.
    decisions : ndarray of words, shape (1 + 2 g + 2 c,)
        The columns of the flags, as words.
    mean : ndarray, shape (1, 64)
        Geometric means of a group.
    deviations, levels : ndarray, shape (e, 64)
        For the common mode and for the votes; empty if these do not need them.
    statistics : ndarray, shape (v, 64)
        Statistic of each vote.
    """

    block: Floats
    common_v: Floats
    digits: NDArray[np.uint64]
    on: NDArray[np.uint64]
    valid: NDArray[np.uint64]
    steps: NDArray[np.uint64]
    held: NDArray[np.uint64]
    decisions: NDArray[np.uint64]
    mean: Floats
    deviations: Floats
    levels: Floats
    statistics: Floats


@compiled_in_place
def settings_of(plan):
    """Return the settings of a plan."""
    return Settings(
        plan[0], plan[1], plan[2], plan[3], plan[4], plan[5], plan[6], plan[7], plan[8], plan[9],
        plan[10], plan[11], plan[12], plan[13], plan[14], plan[15], plan[16], plan[17], plan[18],
        plan[19], plan[20], plan[21], plan[22], plan[23], plan[24], plan[25],
    )  # fmt: skip


@compiled_in_place
def filters_of(plan, settings):
    """Return ranges, least noise floors and sections of a plan, and the index after them.

    The ranges of good samples have the shape (t, 2, 16), the floors, in dB, (t, 16), or (0, 16)
    without evidence, and the sections (s, 6).
    """
    tiles, sections = int(settings.tiles), int(settings.sections)
    floors = tiles * int(settings.evidence)
    begin = len(settings)
    ranges = float_part(plan, begin, (tiles, 2, LANES))
    begin += tiles * 2 * LANES
    least_db = float_part(plan, begin, (floors, LANES))
    begin += floors * LANES
    return ranges, least_db, float_part(plan, begin, (sections, 6)), begin + sections * 6


@compiled_in_place
def layout_of(plan, settings, bases):
    """Return the layout of a plan, which begins at the index ``bases``, and the index after it."""
    enabled, tiles = int(settings.enabled), int(settings.tiles)
    channels, votes = int(settings.channels), int(settings.votes)
    columns = bases + tiles
    seats = columns + enabled
    places = seats + enabled
    bounds = places + tiles * LANES
    members = bounds + int(settings.groups) + 1
    flag_seats = members + enabled
    wanted = flag_seats + channels
    layout = Layout(
        integer_part(plan, bases, (tiles,)),
        integer_part(plan, columns, (enabled,)),
        integer_part(plan, seats, (enabled,)),
        integer_part(plan, places, (tiles * LANES,)),
        integer_part(plan, bounds, (int(settings.groups) + 1,)),
        integer_part(plan, members, (enabled,)),
        integer_part(plan, flag_seats, (channels,)),
        integer_part(plan, wanted, (votes,)),
    )
    return layout, wanted + votes


@compiled_in_place
def _scratch_bounds(settings, begin):
    """Return the index of each part of the working memory, and the index after the last."""
    enabled, votes = int(settings.enabled), int(settings.votes)
    gathered = settings.vote == VOTE_MEAN or votes > 0
    words = 1 if gathered else CHUNK_WORDS
    block = begin + -begin % LINE
    common_v = block + WORD_ROWS * LANES
    digits = common_v + words * WORD_ROWS
    on = digits + DIGITS
    valid = on + words * (int(settings.tiles) * LANES + 1)
    steps = valid + words * (int(settings.tiles) * LANES + 1)
    held = steps
    if settings.impact_v > 0.0:
        held += int(settings.tiles) * LANES
    decisions = held + words
    mean = decisions + 1 + 2 * int(settings.groups) + 2 * int(settings.channels)
    deviations = mean + WORD_ROWS
    levels = deviations
    if settings.common_mode != NO_COMMON_MODE:
        levels += enabled * WORD_ROWS
    statistics = levels
    if gathered:
        statistics += enabled * WORD_ROWS
    end = statistics + votes * WORD_ROWS
    return (
        block, common_v, digits, on, valid, steps, held, decisions, mean, deviations, levels,
        statistics, end,
    )  # fmt: skip


@compiled_in_place
def scratch_of(plan, settings, begin):
    """Return the working memory of a plan: from the first cache line at or after ``begin`` on."""
    (
        block, common_v, digits, on, valid, steps, held, decisions, mean, deviations, levels,
        statistics, end,
    ) = _scratch_bounds(settings, begin)  # fmt: skip
    words = (digits - common_v) // WORD_ROWS
    return Scratch(
        float_part(plan, block, (WORD_ROWS, LANES)),
        float_part(plan, common_v, (words, WORD_ROWS)),
        word_part(plan, digits, (DIGITS,)),
        word_part(plan, on, (words, (valid - on) // words)),
        word_part(plan, valid, (words, (steps - valid) // words)),
        word_part(plan, steps, (held - steps,)),
        word_part(plan, held, (words,)),
        word_part(plan, decisions, (mean - decisions,)),
        float_part(plan, mean, (1, WORD_ROWS)),
        float_part(plan, deviations, ((levels - deviations) // WORD_ROWS, WORD_ROWS)),
        float_part(plan, levels, ((statistics - levels) // WORD_ROWS, WORD_ROWS)),
        float_part(plan, statistics, ((end - statistics) // WORD_ROWS, WORD_ROWS)),
    )


class Parts(NamedTuple):
    """All parts of a plan.

    Attributes
    ----------
    settings : Settings
    ranges : ndarray, shape (t, 2, 16)
        Ranges of good samples.
    least_db : ndarray, shape (t, 16)
        Least noise floors; of shape (0, 16) without evidence.
    sections : ndarray, shape (s, 6)
    layout : Layout
    scratch : Scratch
    """

    settings: Settings
    ranges: Floats
    least_db: Floats
    sections: Floats
    layout: Layout
    scratch: Scratch


def _parts_of(plan):
    settings = settings_of(plan)
    ranges, least_db, sections, end = filters_of(plan, settings)
    layout, end = layout_of(plan, settings, end)
    return Parts(settings, ranges, least_db, sections, layout, scratch_of(plan, settings, end))


if COMPILED:
    # Returning this many values from a call costs time: its code becomes part of the caller.
    parts_of = compiled_in_place(_parts_of, forceinline=True)
else:

    def parts_of(plan):
        """Return the plan itself, which :func:`plan_of` has divided already."""
        return plan


def plan_of(config: ChainConfig, sections: Floats, votes: Sequence[str | int]) -> Floats | Parts:
    """Return the plan of a chain: one array for a compiled kernel, parts for an interpreted one.

    Parameters
    ----------
    config
        Configuration of the chain.
    sections
        Sections of its filters, shape (s, 6).
    votes
        The votes whose statistic is wanted.

    Raises
    ------
    ValueError
        When a vote is not allowed.
    """
    wanted = vote_numbers(votes)
    disabled = {channel - 1 for channel in config.disabled_channels}
    enabled = [c for c in range(config.channels) if c not in disabled]
    bases = tile_bases_of(config)
    seats: dict[int, int] = {}
    # In an empty range no sample of a disabled channel is good.
    ranges = np.full((len(bases), 2, LANES), [[np.inf], [-np.inf]])
    for t, base in enumerate(bases):
        for lane in range(LANES):
            if base + lane < config.channels and base + lane not in disabled:
                seats.setdefault(base + lane, LANES * t + lane)
                ranges[t, :, lane] = config.valid_range_v
    groups = [[c - 1 for c in m if c - 1 in seats] for m in config.groups.values()]
    members = [seats[c] for group in groups for c in group]
    places = np.full(LANES * len(bases), -1)
    places[members] = np.arange(len(members))
    layout = Layout(
        bases=_integers(bases),
        columns=_integers(enabled),
        seats=_integers([seats[c] for c in enabled]),
        places=places,
        bounds=_integers(np.cumsum([0] + [len(group) for group in groups])),
        members=_integers(members),
        flag_seats=_integers([seats.get(c, LANES * len(bases)) for c in range(config.channels)]),
        votes=wanted,
    )
    evidence = config.decision == 'evidence'
    up_db, down_db = floor_steps_db(config.noise_floor_rate_db_s, config.sample_rate_hz)
    settings = Settings(
        flat_rows=config.samples(config.flat_after_s) if config.flat_after_s else np.inf,
        threshold=config.threshold,
        common_mode=COMMON_MODE_NUMBERS[config.common_mode],
        full_wave=config.rectify == 'full',
        exponent=config.exponent,
        vote=int(vote_numbers([config.vote])[0]),
        envelope_rows=config.samples(config.envelope_window_s),
        level_rows=0 if evidence else config.samples(config.decision_window_s),
        comb_rows=config.mains_rows,
        evidence=evidence,
        floor_range_db=config.noise_floor_range_db,
        floor_up_db=up_db,
        floor_down_db=down_db,
        cap_db=config.evidence_cap_db,
        offset_db=config.evidence_offset_db,
        limit_db_s=config.evidence_limit_db_s,
        period_s=1.0 / config.sample_rate_hz,
        impact_v=config.impact_v if evidence else 0.0,
        impact_channels=config.impact_channels,
        hold_rows=config.samples(config.impact_hold_s),
        channels=config.channels,
        enabled=len(enabled),
        groups=len(groups),
        tiles=len(bases),
        sections=len(sections),
        votes=len(wanted),
    )
    # For other types Numba would compile the functions again.
    settings = Settings(*map(float, settings))
    least_db = least_floors_db(config)
    integers = np.concatenate(layout).view(np.float64)
    told = np.concatenate([settings, ranges.ravel(), least_db.ravel(), sections.ravel(), integers])
    plan = aligned(np.zeros, (_scratch_bounds(settings, len(told))[-1],))
    plan[: len(told)] = told
    return plan if COMPILED else _parts_of(plan)


def _integers(values: ArrayLike) -> NDArray[np.int64]:
    return np.array(values, dtype=np.int64)
