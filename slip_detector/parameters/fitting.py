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

from slip_detector.parameters.detector import LOWEST_EDGE, ChainConfig, default_channel_names
from slip_detector.parameters.sets import changed

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
    >>> [rounded_rate_hz(hz) for hz in (199.6, 59.94, 312.4968, 1999.1)]
    [200.0, 60.0, 312.5, 2000.0]
    """
    short_hz = float(f'{rate_hz:.2g}')
    is_near = abs(short_hz - rate_hz) <= 5e-3 * rate_hz
    return short_hz if is_near else float(f'{2 * rate_hz:.3g}') / 2


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
    """Return the values to set so that a configuration fits a sensor; None deletes a group.

    What fits stays. Other channels become one group, in which two have to agree, and what was
    given for each channel is dropped. Where a band does not fit the rate, all above 20 Hz passes,
    and stop-bands, contact and activity are left out; so is the mains, if the rate has none.

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
    passband_hz [20.0, 0.0]
    stopbands_hz []
    vote 2
    groups.TP None
    groups.TD None
    groups.LR None
    groups.LU None
    groups.all [1, 2, 3]
    """
    now, before_hz = config.to_parameters(), config.sample_rate_hz
    rate_hz = rounded_rate_hz(rate_hz) if rates_differ(rate_hz, before_hz) else before_hz
    windows = {name: max(now[name], 1 / rate_hz) for name in now if name.endswith('_window_s')}
    kept = {**now, 'sample_rate_hz': rate_hz, **windows}
    if channels != config.channels:
        kept = {name: value for name, value in kept.items() if not name.startswith('groups.')}
        kept |= {name: [] for name in ('disabled_channels', 'taxel_positions_m') if name in now}
        kept |= {'channels': channels, 'groups.all': [*range(1, channels + 1)]}
        vote = VOTE if config.vote == 'all' else config.vote
        kept['vote'] = vote if vote == 'mean' else min(int(vote), channels)
        if config.decision == 'evidence':
            kept |= {n: min(now[n], channels) for n in ('impact_channels', 'contact_channels')}
        if len(config.noise_floor) > 1:  # Learnt for each channel.
            kept |= {'noise_floor': [min(config.noise_floor)], 'noise_floor_learnt': False}
    from_hz = max(min(PASS_FROM_HZ, PASS_SHARE * rate_hz), LOWEST_EDGE * rate_hz)
    high_pass: dict[str, Any] = {'passband_hz': [from_hz, 0.0], 'stopbands_hz': []}
    high_pass |= {'contact_level_v': 0.0, 'activity_cap_db': 0.0}
    unnamed = tuple(names) == default_channel_names(channels)
    given = [] if unnamed else [*names] or now['channel_names']
    # Of each, the first that fits is taken; the last one always does.
    for its_names, bands, mains_hz in itertools.product(
        [given, []], [{}, high_pass], [config.mains_hz, 0.0]
    ):
        wanted = kept | bands | {'channel_names': its_names, 'mains_hz': mains_hz}
        wanted = {name: wanted.get(name) for name in {**now, **wanted}}
        differing = {name: value for name, value in wanted.items() if value != now.get(name)}
        with contextlib.suppress(ValueError):
            changed(config, differing)
            break
    return differing
