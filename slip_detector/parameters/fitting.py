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

"""What makes a configuration fit a sensor of which only channels and rate are known."""

import contextlib
import itertools
from collections.abc import Sequence
from typing import Any

from slip_detector.parameters.chain import LOWEST_EDGE, ChainConfig, default_channel_names

#: Largest difference between the rates of samples and of the chain, as a share. With a larger one,
#: bands and windows would differ noticeably from the configured ones.
RATE_TOLERANCE = 0.02

#: Where bands do not fit the rate, all above this passes; below it is mostly hand and arm. At low
#: rates it is this share of the rate.
PASS_FROM_HZ, PASS_SHARE = 20.0, 1 / 3

#: Channels that have to agree in a group of all: each sensor has some that feel little.
VOTE = 2


def rounded_rate_hz(rate_hz: float) -> float:
    """Return a measured rate as its sensor's data sheet may have it.

    Examples
    --------
    >>> [rounded_rate_hz(hz) for hz in (198.6, 121.4, 312.4968, 2018.1)]
    [200.0, 121.5, 312.5, 2000.0]
    """
    for digits, share in ((1, 0.015), (2, 0.005)):
        near_hz = float(f'{rate_hz:.{digits}g}')
        if abs(near_hz - rate_hz) <= share * rate_hz:
            return near_hz
    return float(f'{2 * rate_hz:.3g}') / 2


def rates_differ(rate_hz: float, chain_rate_hz: float) -> bool:
    """Return whether the rate of samples is too far from the one that a chain is configured for.

    Examples
    --------
    >>> rates_differ(375.0, 380.0), rates_differ(300.0, 380.0)
    (False, True)
    """
    return abs(rate_hz - chain_rate_hz) > RATE_TOLERANCE * chain_rate_hz


def fitting(
    config: ChainConfig, channels: int, rate_hz: float, names: Sequence[str] = ()
) -> dict[str, Any]:
    """Return the values to set so that a configuration fits a sensor.

    What fits stays. Other channels become one group, in which two have to agree, and floors of
    single channels are left out. Where a band does
    not fit the rate, all above 20 Hz passes, and stop-bands, contact and activity are left out; so
    is the mains, if the rate has none.

    Parameters
    ----------
    config
        The configuration, from which the values differ.
    channels, rate_hz
        Number of channels, and measured rate of the samples, which is rounded.
    names
        Names of the channels; none, or such as cannot be names of topics: those configured, if
        they fit.

    Examples
    --------
    >>> for name, value in fitting(ChainConfig(), 3, 200.0).items():
    ...     print(name, value)
    sample_rate_hz 200.0
    channels 3
    groups.all [1, 2, 3]
    vote 2
    passband_hz [20.0, 0.0]
    stopbands_hz []
    """
    now, before_hz = config.to_parameters(), config.sample_rate_hz
    rate_hz = rounded_rate_hz(rate_hz) if rates_differ(rate_hz, before_hz) else before_hz
    values: dict[str, Any] = {'sample_rate_hz': rate_hz}
    values |= {name: max(now[name], 1 / rate_hz) for name in now if name.endswith('_window_s')}
    if channels != config.channels:
        values |= {'channels': channels, 'groups.all': [*range(1, channels + 1)]}
        if len(config.noise_floor) > 1:
            values |= {'noise_floor': [], 'noise_floor_learnt': False}
        vote = VOTE if config.vote == 'all' else config.vote
        values['vote'] = vote if vote == 'mean' else min(int(vote), channels)
        if config.decision == 'evidence':
            values |= {n: min(now[n], channels) for n in ('impact_channels', 'contact_channels')}
    from_hz = max(min(PASS_FROM_HZ, PASS_SHARE * rate_hz), LOWEST_EDGE * rate_hz)
    high_pass: dict[str, Any] = {'passband_hz': [from_hz, 0.0], 'stopbands_hz': []}
    high_pass |= {'contact_level_v': 0.0, 'activity_cap_db': 0.0}
    unnamed = tuple(names) == default_channel_names(channels)
    known = [] if unnamed else [*names] or now['channel_names']
    # Of each, the first that fits is taken; the last one always does.
    for channel_names, bands, mains_hz in itertools.product(
        [known, []], [{}, high_pass], [config.mains_hz, 0.0]
    ):
        wanted = values | bands | {'channel_names': channel_names, 'mains_hz': mains_hz}
        differing = {name: value for name, value in wanted.items() if value != now.get(name)}
        with contextlib.suppress(ValueError):
            config.with_values(differing)
            break
    return differing
