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

After Romeo et al., 'Slippage Detection with Piezoresistive Tactile Sensors', Sensors 17 (2017)
1844: band-pass, two stop-bands, rectify, raise to a power, RMS envelope, windowed mean, threshold;
and the vote. What evidence makes of the envelope is in :mod:`chain.reference_evidence`, a
function for each equation.

Every rule is written out on its own, in the order it is stated, and for a whole recording at once;
nothing is shared with the fast kernel it is compared with.
"""

from types import SimpleNamespace

import numpy as np
from chain.reference_evidence import after_impact, low_band, mains_rows, take_off_mains
from chain.reference_filters import filter_input, filter_sections, low_sections, run_filter
from numpy.lib.stride_tricks import sliding_window_view


def reference(volts, config):
    """Run the slip-detection chain over a recording.

    Parameters
    ----------
    volts : numpy.ndarray
        Samples, shape (n, c), oldest row first.
    config
        An object with the parameters of the chain as attributes.

    Returns
    -------
    types.SimpleNamespace
        enabled (c,) bool, valid (n, c) bool, envelope (n, c) float; by the mean level (n, c) float
        and channels (n, c) bool; by evidence low (n, c) float and after_impact (n,) bool.
    """
    enabled = np.ones(volts.shape[1], dtype=bool)
    enabled[np.array(config.disabled_channels, dtype=int) - 1] = False

    low, high = config.valid_range_v
    ok = np.isfinite(volts) & (volts >= low) & (volts <= high)
    valid = ok & ~_flat(volts, ok, config.flat_after_s, config.sample_rate_hz) & enabled

    comb_rows = mains_rows(config.mains_hz, config.sample_rate_hz)
    deviations = filter_input(volts, ok, valid, config.common_mode)
    x = take_off_mains(deviations, ok, comb_rows)
    y = config.gain * run_filter(x, ok, filter_sections(config))
    rectified = np.abs(y) if config.rectify == 'full' else np.maximum(y, 0.0)
    powered = rectified**config.exponent

    envelope_rows = window_rows(config.envelope_window_s, config.sample_rate_hz)
    envelope = np.sqrt(_trailing_mean(powered**2, envelope_rows))
    # Cleared here, so that level follows; a disabled channel never shows a number.
    envelope[:, ~enabled] = 0.0
    found = SimpleNamespace(enabled=enabled, valid=valid, envelope=envelope)
    if config.decision == 'evidence':
        found.low, rate = np.zeros(volts.shape), config.sample_rate_hz
        if low_band(config) is not None:
            slow = run_filter(deviations, ok, low_sections(config))
            found.low = np.sqrt(_trailing_mean(slow**2, envelope_rows))
        step_rows, hold_rows = (
            window_rows(seconds, rate) for seconds in (config.impact_s, config.impact_hold_s)
        )
        found.after_impact = after_impact(volts, ok, enabled, config, step_rows, hold_rows)
    else:
        decision_rows = window_rows(config.decision_window_s, config.sample_rate_hz)
        found.level = _trailing_mean(envelope, decision_rows)
        # Validity is not asked here: a bad sample holds the filter's input, it doesn't
        # switch the channel off. It only bars the channel from the vote.
        found.channels = (found.level > config.threshold) & enabled
    return found


def window_rows(seconds, sample_rate_hz):
    """Return the length of a window in rows, at least 1."""
    return max(1, round(float(seconds) * float(sample_rate_hz)))


def _flat(volts, ok, flat_after_s, sample_rate_hz):
    """Mark the samples at which a channel has stood still for too long; 0: for ever."""
    flat = np.zeros(volts.shape, dtype=bool)
    if flat_after_s == 0:
        return flat
    flat_rows = window_rows(flat_after_s, sample_rate_hz)
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


def _trailing_mean(values, n_rows):
    """Average each column over the last rows, with zeros before the first."""
    if values.shape[0] == 0:
        return values.copy()
    # Every window is summed afresh. A running sum would be faster, but after a large value
    # has left it, what remains is that value's rounding error.
    padded = np.concatenate([np.zeros((n_rows - 1, values.shape[1])), values])
    return sliding_window_view(padded, n_rows, axis=0).sum(axis=-1) / n_rows


def vote_of(config, level, channels, valid):
    """Return which groups are ON, and which have enough valid channels; shape (n, g) each.

    ``level`` is what is compared with the threshold, ``channels`` which channels are ON.
    """
    needed = 1 if config.vote in ('all', 'mean') else config.vote
    decided = np.zeros((level.shape[0], len(config.groups)), dtype=bool)
    can_vote = np.zeros_like(decided)
    for index, members in enumerate(config.groups.values()):
        columns = np.array(members, dtype=int) - 1
        for row in range(level.shape[0]):
            voters = columns[valid[row, columns]]
            can_vote[row, index] = voters.size >= needed
            if not can_vote[row, index]:
                continue
            if config.vote == 'all':
                decided[row, index] = channels[row, voters].all()
            elif config.vote == 'mean':
                levels = level[row, voters]
                # In logarithms, because a product of many small or large ratios leaves the range
                # of a float; as a difference, because even one ratio may.
                if levels.all():
                    score = np.mean(np.log(levels) - np.log(config.threshold))
                    decided[row, index] = score > 0
            else:
                decided[row, index] = np.count_nonzero(channels[row, voters]) >= needed
    return decided, can_vote
