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

"""Checks of a chain's parameters against each other.

Each check takes a ``ChainConfig`` and raises a ValueError of one line: the parameter, its value
and the allowed values.
"""

from typing import Any

from slip_detector.parameters.conversion import check_once

#: Lowest band edge, as a fraction of the sample rate; below it, round-off ruins the filter.
LOWEST_EDGE = 1e-5

#: Most stop-bands: each one adds a filter to the computation of every row.
MOST_STOPBANDS = 32

#: Longest delay of the mains comb; it must be whole in both rows and mains periods.
LONGEST_COMB_S = 0.25


def check_channels(config: Any) -> None:
    """Check the channel names and the disabled channels against the number of channels.

    Examples
    --------
    >>> from slip_detector import ChainConfig
    >>> check_channels(ChainConfig(channels=2, groups={'tip': (1, 2)}, vote=1))
    >>> ChainConfig(channels=2, groups={'tip': (1, 2)}, disabled_channels=(3,))
    Traceback (most recent call last):
        ...
    ValueError: parameter disabled_channels has 3, allowed: 1 to 2
    """
    if config.channel_names and len(config.channel_names) != config.channels:
        raise ValueError(
            f'parameter channel_names has {len(config.channel_names)} names, '
            f'allowed: {config.channels}, the number of channels'
        )
    check_once(config.disabled_channels, 'parameter disabled_channels', 'channel')
    for channel in config.disabled_channels:
        if not 1 <= channel <= config.channels:
            raise ValueError(
                f'parameter disabled_channels has {channel}, allowed: 1 to {config.channels}'
            )
    if len(config.disabled_channels) == config.channels:
        raise ValueError('parameter disabled_channels names every channel, allowed: all but one')


def check_groups(config: Any) -> None:
    """Check that each enabled channel is in one group, and the groups against the vote.

    Examples
    --------
    >>> from slip_detector import ChainConfig
    >>> check_groups(ChainConfig(channels=2, groups={'left': (1,), 'right': (2,)}))
    >>> ChainConfig(channels=2, groups={'left': (1, 2), 'right': (2,)})  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    ValueError: parameter groups.right has channel 2, which is in left already, allowed: ...
    """
    group_of: dict[int, str] = {}
    disabled = set(config.disabled_channels)
    for name, members in config.groups.items():
        where = f'parameter groups.{name}'
        if not members:
            raise ValueError(f'{where} is empty, allowed: at least one channel')
        for channel in members:
            if not 1 <= channel <= config.channels:
                raise ValueError(f'{where} has channel {channel}, allowed: 1 to {config.channels}')
            if channel in group_of:
                raise ValueError(
                    f'{where} has channel {channel}, which is in {group_of[channel]} already, '
                    'allowed: one group for a channel'
                )
            group_of[channel] = name
        able = len(set(members) - disabled)
        if isinstance(config.vote, int) and 0 < able < config.vote:
            raise ValueError(
                f'parameter vote is {config.vote}, allowed: at most {able}, the enabled '
                f'channels of group {name}'
            )
    for channel in range(1, config.channels + 1):
        if channel not in group_of and channel not in disabled:
            raise ValueError(
                f'parameter groups leaves out channel {channel}, allowed: every channel in '
                'one group or in disabled_channels'
            )


def check_evidence(config: Any) -> None:
    """Check the parameters of the evidence decision; without it, only the number of floors.

    Examples
    --------
    >>> from slip_detector import ChainConfig
    >>> check_evidence(ChainConfig(decision='evidence', noise_floor=(1e-3,)))
    >>> ChainConfig(decision='evidence')  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    ValueError: parameter noise_floor is not given, allowed: ...
    """
    if config.decision != 'evidence':
        if len(config.noise_floor) > config.channels:
            raise ValueError(
                f'parameter noise_floor has {len(config.noise_floor)} numbers, allowed: at most '
                f'{config.channels}, one for each channel'
            )
        return
    floors, enabled = len(config.noise_floor), config.channels - len(set(config.disabled_channels))
    if floors not in (1, config.channels):
        has = f'has {floors} numbers' if floors else 'is not given'
        raise ValueError(
            f'parameter noise_floor {has}, allowed: one number, or {config.channels}, one for '
            'each channel, with decision: evidence'
        )
    if config.evidence_cap_db <= config.evidence_offset_db:
        raise ValueError(
            f'parameter evidence_cap_db is {config.evidence_cap_db:g} dB, allowed: above '
            f'evidence_offset_db ({config.evidence_offset_db:g} dB)'
        )
    if config.threshold >= config.evidence_limit_db_s:
        raise ValueError(
            f'parameter threshold is {config.threshold:g} dB s, allowed: below '
            f'evidence_limit_db_s ({config.evidence_limit_db_s:g} dB s)'
        )
    if config.impact_v and config.impact_channels > enabled:
        raise ValueError(
            f'parameter impact_channels is {config.impact_channels}, allowed: at most '
            f'{enabled}, the number of enabled channels'
        )


def check_filters(config: Any) -> None:
    """Check the edges and degrees of the filters, and the mains frequency, at the sample rate.

    Examples
    --------
    >>> from slip_detector import ChainConfig
    >>> check_filters(ChainConfig(passband_hz=(7.0, 50.0)))
    >>> ChainConfig(passband_hz=(7.0, 200.0))  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    ValueError: parameter passband_hz has the edge 200 Hz, allowed: ...
    """
    low, high = config.passband_hz
    _check_edge(config, 'passband_hz', low)
    if high != 0.0:
        _check_edge(config, 'passband_hz', high)
        _check_order('passband_hz', low, high)
        if config.passband_degree % 2:
            raise ValueError(
                f'parameter passband_degree is {config.passband_degree}, allowed: an even '
                'number (a band-pass has two edges of equal degree)'
            )
    if len(config.stopbands_hz) > MOST_STOPBANDS:
        raise ValueError(
            f'parameter stopbands_hz has {len(config.stopbands_hz)} pairs, allowed: at most '
            f'{MOST_STOPBANDS}'
        )
    for pair in config.stopbands_hz:
        for edge in pair:
            _check_edge(config, 'stopbands_hz', edge)
        _check_order('stopbands_hz', *pair)
    if config.stopband_degree % 2:
        raise ValueError(
            f'parameter stopband_degree is {config.stopband_degree}, allowed: an even number'
        )
    if config.mains_hz and not config.mains_rows:
        raise ValueError(
            f'parameter mains_hz is {config.mains_hz:g} Hz, allowed: 0, or a frequency with '
            f'whole periods in at most {LONGEST_COMB_S:g} s of rows at '
            f'{config.sample_rate_hz:g} Hz'
        )


def _check_edge(config: Any, name: str, edge_hz: float) -> None:
    # Rounding can put 1e-5 times the rate one last digit above the number that a user writes.
    lowest = LOWEST_EDGE * config.sample_rate_hz * (1 - 1e-12)
    nyquist = config.sample_rate_hz / 2
    if not lowest <= edge_hz < nyquist:
        raise ValueError(
            f'parameter {name} has the edge {edge_hz:g} Hz, allowed: {lowest:g} Hz to below '
            f'{nyquist:g} Hz (half the sample rate)'
        )


def _check_order(name: str, low_hz: float, high_hz: float) -> None:
    if low_hz >= high_hz:
        raise ValueError(
            f'parameter {name} has the edges {low_hz:g} and {high_hz:g} Hz, allowed: the '
            'low edge first'
        )


def check_windows(config: Any) -> None:
    """Check the windows and the valid range of the samples.

    Examples
    --------
    >>> from slip_detector import ChainConfig
    >>> check_windows(ChainConfig(envelope_window_s=0.04))
    >>> ChainConfig(envelope_window_s=0.001)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    ValueError: parameter envelope_window_s is 0.001 s, allowed: ...
    """
    for name in ('envelope_window_s', 'decision_window_s'):
        seconds = getattr(config, name)
        if seconds * config.sample_rate_hz < 1 - 1e-6:
            raise ValueError(
                f'parameter {name} is {seconds:g} s, allowed: at least one sample '
                f'({1 / config.sample_rate_hz:.6g} s at {config.sample_rate_hz:g} Hz)'
            )
    low, high = config.valid_range_v
    if low >= high:
        raise ValueError(
            f'parameter valid_range_v is [{low:g}, {high:g}] V, allowed: low below high'
        )
