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

"""Checks of a chain's parameters against each other; a bad value is a ValueError of one line."""

from typing import Any

from slip_detector.parameters.fields import check_once

#: Lowest band edge, as a fraction of the sample rate; below it, round-off ruins the filter.
LOWEST_EDGE = 1e-5

#: Most stop-bands: each one adds a filter to the computation of every row.
MOST_STOPBANDS = 32

#: Longest delay of the mains comb; it must be whole in both rows and mains periods.
LONGEST_COMB_S = 0.25


def check_chain(config: Any) -> None:
    """Check all parameters of a ``ChainConfig`` that depend on each other."""
    check_channels(config)
    check_groups(config)
    check_filters(config)
    check_windows(config)
    check_evidence(config)


def check_channels(config: Any) -> None:
    """Check the channel names and the disabled channels against the number of channels."""
    names, disabled, channels = config.channel_names, config.disabled_channels, config.channels
    if len(names) not in (0, channels):
        allowed = f'{channels}, the number of channels'
        config.refuse('channel_names', allowed, f'has {len(names)} names')
    check_once(disabled, 'parameter disabled_channels', 'channel')
    for channel in disabled:
        if not 1 <= channel <= channels:
            config.refuse('disabled_channels', f'1 to {channels}', f'has {channel}')
    if len(disabled) == channels:
        config.refuse('disabled_channels', 'all but one', 'names every channel')


def check_groups(config: Any) -> None:
    """Check that each enabled channel is in one group, and the groups against the vote."""
    group_of: dict[int, str] = {}
    disabled = set(config.disabled_channels)
    for name, members in config.groups.items():
        if not members:
            raise ValueError(f'parameter groups.{name} is empty, allowed: at least one channel')
        for channel in members:
            has = f'parameter groups.{name} has channel {channel}'
            if not 1 <= channel <= config.channels:
                raise ValueError(f'{has}, allowed: 1 to {config.channels}')
            if channel in group_of:
                in_it = f'which is in {group_of[channel]} already'
                raise ValueError(f'{has}, {in_it}, allowed: one group for a channel')
            group_of[channel] = name
        able = len(set(members) - disabled)
        if isinstance(config.vote, int) and 0 < able < config.vote:
            config.refuse('vote', f'at most {able}, the enabled channels of group {name}')
    left_out = set(range(1, config.channels + 1)) - disabled - group_of.keys()
    if left_out:
        allowed = 'every channel in one group or in disabled_channels'
        config.refuse('groups', allowed, f'leaves out channel {min(left_out)}')


def check_filters(config: Any) -> None:
    """Check the edges and degrees of the filters, and the mains frequency, at the sample rate."""
    low, high = config.passband_hz
    # A high edge of 0 makes a high-pass.
    _check_edges(config, 'passband_hz', *([low, high] if high else [low]))
    if high and config.passband_degree % 2:
        allowed = 'an even number (a band-pass has two edges of equal degree)'
        config.refuse('passband_degree', allowed)
    if len(config.stopbands_hz) > MOST_STOPBANDS:
        has = f'has {len(config.stopbands_hz)} pairs'
        config.refuse('stopbands_hz', f'at most {MOST_STOPBANDS}', has)
    for pair in config.stopbands_hz:
        _check_edges(config, 'stopbands_hz', *pair)
    if config.stopband_degree % 2:
        config.refuse('stopband_degree', 'an even number')
    if config.mains_hz and not config.mains_rows:
        config.refuse(
            'mains_hz',
            f'0, or a frequency with whole periods in at most {LONGEST_COMB_S:g} s of rows at '
            f'{config.sample_rate_hz:g} Hz',
        )


def _check_edges(config: Any, name: str, *edges_hz: float) -> None:
    # Rounding can put 1e-5 times the rate one last digit above the number that a user writes.
    lowest = LOWEST_EDGE * config.sample_rate_hz * (1 - 1e-12)
    nyquist = config.sample_rate_hz / 2
    for edge in edges_hz:
        if not lowest <= edge < nyquist:
            allowed = f'{lowest:g} Hz to below {nyquist:g} Hz (half the sample rate)'
            config.refuse(name, allowed, f'has the edge {edge:g} Hz')
    if len(edges_hz) > 1 and edges_hz[0] >= edges_hz[1]:
        has = f'has the edges {edges_hz[0]:g} and {edges_hz[1]:g} Hz'
        config.refuse(name, 'the low edge first', has)


def check_windows(config: Any) -> None:
    """Check the windows and the valid range of the samples."""
    rate_hz = config.sample_rate_hz
    for name in ('envelope_window_s', 'decision_window_s'):
        if getattr(config, name) * rate_hz < 1 - 1e-6:
            config.refuse(name, f'at least one sample ({1 / rate_hz:.6g} s at {rate_hz:g} Hz)')
    low, high = config.valid_range_v
    if low >= high:
        config.refuse('valid_range_v', 'low below high', f'is [{low:g}, {high:g}] V')


def check_evidence(config: Any) -> None:
    """Check the parameters of the evidence decision; without it, only the number of floors."""
    floors, channels = len(config.noise_floor), config.channels
    each = f'{channels}, one for each channel'
    if config.decision != 'evidence':
        if floors > channels:
            config.refuse('noise_floor', f'at most {each}', f'has {floors} numbers')
        return
    if floors not in (1, channels):
        has = f'has {floors} numbers' if floors else 'is not given'
        config.refuse('noise_floor', f'one number, or {each}, with decision: evidence', has)
    offset_db, limit_db_s = config.evidence_offset_db, config.evidence_limit_db_s
    if config.evidence_cap_db <= offset_db:
        config.refuse('evidence_cap_db', f'above evidence_offset_db ({offset_db:g} dB)')
    if config.threshold >= limit_db_s:
        allowed = f'below evidence_limit_db_s ({limit_db_s:g} dB s)'
        config.refuse('threshold', allowed, f'is {config.threshold:g} dB s')
    enabled = channels - len(set(config.disabled_channels))
    if config.impact_v and config.impact_channels > enabled:
        allowed = f'at most {enabled}, the number of enabled channels'
        config.refuse('impact_channels', allowed)
