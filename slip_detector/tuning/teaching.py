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

"""What is learnt of a finger before a search: where it begins, its noise and its impacts."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

from slip_detector.parameters import ChainConfig
from slip_detector.tuning.learning import impact_step, learn_from_rest
from slip_detector.tuning.tracks import Track

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
    """Learn noise and impacts of a finger; return the chain with them, and lines about them."""
    chain, lines = beginning(chain), []
    slips = [track for track in tracks if track.slips]
    for what, kind in (('noise', 'rest'), ('impacts', 'taps')):
        of_kind = [track for track in tracks if track.kind == kind]
        if not of_kind:
            lines.append(f'No {what} learnt: there is no recording for that')
            continue
        longest = max(of_kind, key=lambda track: track.duration_s)
        step(f'learning the {what} of {longest.name}')
        try:
            if kind == 'rest':
                learnt, said = learn_from_rest(longest, chain)
            else:
                impact_v, line = impact_step(chain, longest, slips)
                learnt, said = {'impact_v': impact_v}, [f'On {longest.name}: {line}']
            chain, lines = dataclasses.replace(chain, **learnt), lines + said
        except ValueError as error:  # Taps may look like slips: what was learnt before is kept.
            lines.append(str(error))
    return chain, lines
