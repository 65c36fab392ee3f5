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

"""A slow, plainly written reference of the slip-detection chain.

After Romeo et al., 'Slippage Detection with Piezoresistive Tactile Sensors',
Sensors 17 (2017) 1844: band-pass, two stop-bands, rectify, raise to a power,
RMS envelope, windowed mean, threshold, vote; or evidence in place of the mean.

Every rule is written out on its own, in the order it is stated, and for a whole
recording at once; nothing is shared with the fast kernel it is compared with.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import SimpleNamespace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from support.reference_evidence import decide_by_evidence, mains_rows, take_off_mains
from support.reference_filters import filter_input, filter_sections, run_filter


def reference(
    volts: np.ndarray,
    *,
    sample_rate_hz: float,
    passband_hz: tuple[float, float] = (7, 50),
    passband_degree: int = 4,
    gain: float = 100.0,
    stopbands_hz: Sequence[tuple[float, float]] = ((0.5, 7), (50, 180)),
    stopband_degree: int = 4,
    stopband_ripple_db: float = 0.01,
    stopband_attenuation_db: float = 40.0,
    rectify: str = 'full',
    exponent: int = 3,
    envelope_window_s: float = 0.04,
    decision_window_s: float = 0.04,
    threshold: float = 0.5,
    common_mode: str = 'none',
    valid_range_v: tuple[float, float] = (-1e9, 1e9),
    flat_after_s: float = 1.0,
    disabled_channels: Sequence[int] = (),
    groups: Mapping[str, Sequence[int]] | None = None,
    vote: str | int = 'all',
    mains_hz: float = 0.0,
    decision: str = 'mean',
    noise_floor: float | Sequence[float] = (),
    noise_floor_learnt: bool = False,
    noise_floor_range_db: float = 60.0,
    noise_floor_rate_db_s: float = 0.43,
    evidence_cap_db: float = 13.0,
    evidence_offset_db: float = 3.5,
    evidence_limit_db_s: float = 1.3,
    impact_v: float = 0.0,
    impact_channels: int = 2,
    impact_hold_s: float = 0.3,
) -> SimpleNamespace:
    """Run the slip-detection chain over a recording.

    Parameters
    ----------
    volts : numpy.ndarray
        Samples, shape (n, c), oldest row first.
    sample_rate_hz : float
        Rows per second.
    passband_hz : tuple of float
        Edges of the Butterworth band-pass; an upper edge of 0 makes it a high-pass.
    passband_degree : int
        Degree of the finished pass-band filter.
    gain : float
        Factor on the output of the filters.
    stopbands_hz : sequence of tuple of float
        Edges of each elliptic band-stop, applied in this order.
    stopband_degree : int
        Degree of each finished band-stop.
    stopband_ripple_db, stopband_attenuation_db : float
        Pass-band ripple and stop-band attenuation of each band-stop.
    rectify : {'full', 'half'}
        Full-wave |y| or half-wave max(y, 0).
    exponent : int
        Power the rectified signal is raised to, at least 1.
    envelope_window_s, decision_window_s : float
        Lengths of the RMS window and of the mean window after it.
    threshold : float
        A channel is ON while its level is above this.
    common_mode : {'none', 'mean', 'median'}
        What is taken off every channel's deviation before the filters.
    valid_range_v : tuple of float
        Lowest and highest credible value, both included.
    flat_after_s : float
        How long a value may stand still before the channel stops being valid; 0 = for ever.
    disabled_channels : sequence of int
        Channels that take no part, counted from 1.
    groups : mapping of str to sequence of int, optional
        Channels of each voting group, counted from 1; one group of all channels if None.
    vote : {'all', 'mean'} or int
        Rule by which a group's valid channels decide.
    mains_hz : float
        Mains that a comb takes off before the filters; 0: none.
    decision : {'mean', 'evidence'}
        What is held against the threshold.
    noise_floor, noise_floor_learnt, noise_floor_range_db, noise_floor_rate_db_s,
    evidence_cap_db, evidence_offset_db, evidence_limit_db_s,
    impact_v, impact_channels, impact_hold_s
        Of the evidence, see :mod:`support.reference_evidence`.

    Returns
    -------
    types.SimpleNamespace
        slip (n,) bool, groups (n, g) bool, can_vote (n, g) bool, channels (n, c) bool,
        valid (n, c) bool, envelope (n, c) float, level (n, c) float, held (n, c) float: what is
        held against the threshold; with evidence also floor, excess (n, c) float and
        after_impact (n,) bool.

    Raises
    ------
    ValueError
        If an option is outside of what is described above.
    """
    options = SimpleNamespace(**locals())
    volts = np.asarray(volts, dtype=np.float64)
    if volts.ndim != 2:
        raise ValueError('volts must have the shape (rows, channels)')
    n_channels = volts.shape[1]
    # Written so that a threshold of NaN is refused as well.
    if not threshold >= 0:
        raise ValueError('threshold must not be negative')
    if groups is None:
        groups = {'all': range(1, n_channels + 1)}

    enabled = np.ones(n_channels, dtype=bool)
    enabled[_columns(disabled_channels, n_channels)] = False

    low, high = valid_range_v
    ok = np.isfinite(volts) & (volts >= low) & (volts <= high)
    flat = _flat(volts, ok, flat_after_s, sample_rate_hz)
    valid = ok & ~flat & enabled

    comb_rows = mains_rows(mains_hz, sample_rate_hz)
    x = take_off_mains(filter_input(volts, ok, valid, common_mode), ok, comb_rows)
    sections = filter_sections(
        sample_rate_hz,
        passband_hz,
        passband_degree,
        stopbands_hz,
        stopband_degree,
        stopband_ripple_db,
        stopband_attenuation_db,
    )
    y = gain * run_filter(x, ok, sections)
    powered = _powered(y, rectify, exponent)

    envelope_rows = _window_rows(envelope_window_s, sample_rate_hz)
    decision_rows = _window_rows(decision_window_s, sample_rate_hz)
    envelope = np.sqrt(_trailing_mean(powered**2, envelope_rows))
    # Cleared here, so that level follows; a disabled channel never shows a number.
    envelope[:, ~enabled] = 0.0
    if decision == 'evidence':
        hold_rows = _window_rows(impact_hold_s, sample_rate_hz)
        decided = decide_by_evidence(
            volts, ok, valid, enabled, envelope, comb_rows + envelope_rows, hold_rows, options
        )
    else:
        level = _trailing_mean(envelope, decision_rows)
        # Validity is not asked here: a bad sample holds the filter's input, it doesn't
        # switch the channel off. It only bars the channel from the vote.
        decided = SimpleNamespace(level=level, held=level, channels=level > threshold)
    decided.channels &= enabled

    in_groups, can_vote = _vote(decided.held, decided.channels, valid, threshold, groups, vote)
    return SimpleNamespace(
        slip=in_groups.any(axis=1),
        groups=in_groups,
        can_vote=can_vote,
        valid=valid,
        envelope=envelope,
        **vars(decided),
    )


def _columns(channel_numbers: Sequence[int], n_channels: int) -> list[int]:
    """Turn channel numbers counted from 1 into column indices.

    Parameters
    ----------
    channel_numbers : sequence of int
        Channel numbers counted from 1.
    n_channels : int
        How many channels there are.

    Returns
    -------
    list of int
        Column indices counted from 0.

    Raises
    ------
    ValueError
        If a number is out of range (0 would silently mean the last column) or twice there.
    """
    numbers = [int(number) for number in channel_numbers]
    if any(not 1 <= number <= n_channels for number in numbers):
        raise ValueError(f'channel numbers must be in 1..{n_channels}: {numbers}')
    if len(set(numbers)) != len(numbers):
        raise ValueError(f'a channel number occurs twice: {numbers}')
    return [number - 1 for number in numbers]


def _window_rows(seconds: float, sample_rate_hz: float) -> int:
    """Return the length of a window in rows, at least 1.

    Parameters
    ----------
    seconds : float
        Length of the window.
    sample_rate_hz : float
        Rows per second.

    Returns
    -------
    int
        Rows; exact halves go to the even number, as Python's round does.
    """
    return max(1, round(float(seconds) * float(sample_rate_hz)))


def _flat(
    volts: np.ndarray, ok: np.ndarray, flat_after_s: float, sample_rate_hz: float
) -> np.ndarray:
    """Mark the samples at which a channel has stood still for too long.

    Parameters
    ----------
    volts : numpy.ndarray
        Samples, shape (n, c).
    ok : numpy.ndarray
        Which samples are credible, shape (n, c).
    flat_after_s : float
        How long a value may stand still; 0 = for ever.
    sample_rate_hz : float
        Rows per second.

    Returns
    -------
    numpy.ndarray
        Shape (n, c), bool.
    """
    flat = np.zeros(volts.shape, dtype=bool)
    if flat_after_s == 0:
        return flat

    flat_rows = _window_rows(flat_after_s, sample_rate_hz)
    for column in range(volts.shape[1]):
        repeats = 0
        previous_good = None
        for row in range(volts.shape[0]):
            # A bad sample says nothing about whether the sensor moves, so it is passed over.
            if ok[row, column]:
                value = volts[row, column]
                if previous_good is not None and value == previous_good:
                    repeats += 1
                else:
                    repeats = 0
                previous_good = value
            flat[row, column] = repeats >= flat_rows
    return flat


def _powered(y: np.ndarray, rectify: str, exponent: int) -> np.ndarray:
    """Rectify and raise to a power.

    Parameters
    ----------
    y : numpy.ndarray
        Amplified output of the filters, shape (n, c).
    rectify : {'full', 'half'}
        Full-wave |y| or half-wave max(y, 0).
    exponent : int
        The power, at least 1.

    Returns
    -------
    numpy.ndarray
        Shape (n, c), not negative.

    Raises
    ------
    ValueError
        If `rectify` is neither of the two or `exponent` no whole number from 1 on.
    """
    if int(exponent) != exponent or exponent < 1:
        raise ValueError(f'exponent must be a whole number, at least 1: {exponent}')
    if rectify == 'full':
        rectified = np.abs(y)
    elif rectify == 'half':
        rectified = np.maximum(y, 0.0)
    else:
        raise ValueError(f"rectify must be 'full' or 'half': {rectify!r}")
    return rectified ** int(exponent)


def _trailing_mean(values: np.ndarray, n_rows: int) -> np.ndarray:
    """Average each column over the last rows, with zeros before the first.

    Parameters
    ----------
    values : numpy.ndarray
        Shape (n, c).
    n_rows : int
        Length of the window, the current row included.

    Returns
    -------
    numpy.ndarray
        Shape (n, c).
    """
    if values.shape[0] == 0:
        return values.copy()
    # Every window is summed afresh. A running sum would be faster, but after a large value
    # has left it, what remains is that value's rounding error.
    padded = np.concatenate([np.zeros((n_rows - 1, values.shape[1])), values])
    return sliding_window_view(padded, n_rows, axis=0).sum(axis=-1) / n_rows


def _vote(
    level: np.ndarray,
    channels: np.ndarray,
    valid: np.ndarray,
    threshold: float,
    groups: Mapping[str, Sequence[int]],
    vote: str | int,
) -> tuple[np.ndarray, np.ndarray]:
    """Let the valid channels of each group decide.

    Parameters
    ----------
    level : numpy.ndarray
        Shape (n, c).
    channels : numpy.ndarray
        Which channels are ON, shape (n, c).
    valid : numpy.ndarray
        Which channels may vote, shape (n, c).
    threshold : float
        Threshold of the level, for the 'mean' vote.
    groups : mapping of str to sequence of int
        Channels of each group, counted from 1.
    vote : {'all', 'mean'} or int
        Rule of the vote.

    Returns
    -------
    decided : numpy.ndarray
        Which groups are ON, shape (n, g).
    can_vote : numpy.ndarray
        Which groups have enough valid channels, shape (n, g).

    Raises
    ------
    ValueError
        If `vote` is none of the rules.
    """
    # bool is an int, yet vote=True is more likely a mistake than a vote of one channel.
    is_count = isinstance(vote, (int, np.integer)) and not isinstance(vote, bool)
    if not (is_count and vote >= 1) and not (isinstance(vote, str) and vote in ('all', 'mean')):
        raise ValueError(f"vote must be 'all', 'mean' or a whole number from 1 on: {vote!r}")
    needed = int(vote) if is_count else 1

    n_rows = level.shape[0]
    decided = np.zeros((n_rows, len(groups)), dtype=bool)
    can_vote = np.zeros((n_rows, len(groups)), dtype=bool)
    for index, members in enumerate(groups.values()):
        columns = np.array(_columns(members, level.shape[1]), dtype=int)
        for row in range(n_rows):
            voters = columns[valid[row, columns]]
            can_vote[row, index] = voters.size >= needed
            if not can_vote[row, index]:
                continue
            if vote == 'all':
                decided[row, index] = channels[row, voters].all()
            elif vote == 'mean':
                decided[row, index] = _geometric_mean_above(level[row, voters], threshold)
            else:
                decided[row, index] = np.count_nonzero(channels[row, voters]) >= needed
    return decided, can_vote


def _geometric_mean_above(levels: np.ndarray, threshold: float) -> bool:
    """Tell whether the geometric mean of level/threshold is above 1.

    Parameters
    ----------
    levels : numpy.ndarray
        Levels of the voters, at least one.
    threshold : float
        Threshold of the level; at 0, any levels above 0 are above it.

    Returns
    -------
    bool
        False if any level is 0.
    """
    if (levels == 0).any():
        return False
    if threshold == 0:
        return True
    # In logarithms, because a product of many small or large ratios leaves the range of a
    # float; as a difference, because even one ratio may.
    return bool(np.mean(np.log(levels) - np.log(threshold)) > 0)
