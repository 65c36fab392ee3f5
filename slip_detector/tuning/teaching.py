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

"""What is learnt of a finger before a search: where it begins, its bands and its noise."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

from slip_detector.parameters import ChainConfig
from slip_detector.tuning.bands import slip_bands
from slip_detector.tuning.noise import learn_noise
from slip_detector.tuning.tracks import Track, at_rest

#: Where the search for an unknown sensor begins, and its pass-band: from a frequency, or from a
#: share of the sample rate if that is lower.
NEW_SENSOR: dict[str, Any] = {
    'decision': 'evidence',
    'threshold': 0.5,
    'noise_floor': (1e-9,),
    'noise_floor_learnt': ChainConfig.noise_floor_learnt,
    'passband_degree': 2,
    'stopbands_hz': (),
    'gain': 1.0,
    'exponent': 1,
}
LOW_HZ, LOW_SHARE = 20.0, 0.2

#: In a shorter recording of rest the mains show no better than in a longer one of another kind.
LEAST_S = 10.0


def beginning(chain: ChainConfig) -> ChainConfig:
    """Return where learning begins: the given chain, or, without evidence, that of a new sensor.

    Examples
    --------
    >>> beginning(ChainConfig()).passband_hz
    (20.0, 0.0)
    """
    if chain.decision == 'evidence':
        return chain
    low_hz = min(LOW_HZ, LOW_SHARE * chain.sample_rate_hz)
    vote = min(2, *map(len, chain.groups.values()))
    return dataclasses.replace(chain, **NEW_SENSOR, passband_hz=(low_hz, 0.0), vote=vote)


def learn(
    chain: ChainConfig, tracks: Sequence[Track], step: Callable[[str], None]
) -> tuple[ChainConfig, list[str]]:
    """Learn bands, mains and noise of a finger; return where a search begins, and lines on it."""
    chain, lines = beginning(chain), []
    step('measuring where slides stand out')
    bands, line = slip_bands(chain, tracks)
    low_hz, _ = chain.passband_hz
    lines.append(line)
    if bands and bands[0][1] and low_hz >= bands[0][1]:
        lines.append(f'The given pass-band begins above them, at {low_hz:g} Hz')
    quiet = [track for track in tracks if not track.slips]
    if not quiet:
        return chain, [*lines, 'No noise learnt: there is no recording without slips']
    # A recording of rest shows the mains best, if it is long enough.
    resting = [track for track in at_rest(quiet) if track.duration_s >= LEAST_S]
    longest = max(resting or quiet, key=lambda track: track.duration_s)
    step(f'learning the noise of {longest.name}')
    try:
        learnt, said = learn_noise(chain, tracks, longest)
    except ValueError as error:
        return chain, [*lines, str(error)]
    return dataclasses.replace(chain, **learnt), lines + said
