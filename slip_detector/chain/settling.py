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

"""Settling time of a chain after a start or a reset.

The chain assumes that the input was constant before its first row. If it was not, as after a gap
during a slip, the first results are a response to that error and not to the signal.
"""

import math

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled
from slip_detector.chain.evidence import floor_steps_db
from slip_detector.chain.filters import design
from slip_detector.parameters.detector import ChainConfig

#: Filters have settled when their step response is below this share of its peak.
SETTLED = 0.01

#: Lower limit of the offset in the time that evidence takes to fall, which bounds that time.
LEAST_OFFSET_DB = 0.5

#: A floor that is not learnt begins at the first envelope. In noise alone that may be this far
#: above the level where the floor settles.
FIRST_FLOOR_DB = 5.0

#: Number of rows for which the step response is computed first; it is doubled until it suffices.
SHORTEST = 256


def settling_rows(config: ChainConfig) -> int:
    """Return the number of rows in which filters, windows, evidence and floors settle.

    After these rows the response of the filters to a step at the first row has fallen below
    :data:`SETTLED` of its peak, and larger values have left the windows. The response begins only
    after the rows of the mains comb, whose output is 0 before. Evidence has fallen from its limit,
    and a floor that is not learnt by :data:`FIRST_FLOOR_DB`, unless its rate is 0.

    Raises
    ------
    ValueError
        When a filter of the configuration cannot be run in float64.

    Examples
    --------
    >>> settling_rows(ChainConfig())  # 0.43 s: 134 for the filters, 15 for each window
    164
    >>> settling_rows(ChainConfig(stopbands_hz=()))
    94
    >>> evidence = ChainConfig(decision='evidence', noise_floor=1e-3, noise_floor_learnt=True)
    >>> settling_rows(evidence)  # 134, 15 for the envelope, 141 for the evidence
    290
    """
    rows = _comb_rows(config) + _filter_rows(design(config))
    rows += config.samples(config.envelope_window_s)
    if config.decision == 'mean':
        return rows + config.samples(config.decision_window_s)
    return rows + max(config.samples(evidence_falls_s(config)), _floor_rows(config))


def evidence_falls_s(config: ChainConfig) -> float:
    """Return the time, in seconds, in which evidence falls from its limit to 0 in noise alone.

    Examples
    --------
    >>> config = ChainConfig(decision='evidence', noise_floor=1e-3, evidence_offset_db=2.6)
    >>> evidence_falls_s(config)
    0.5
    """
    return config.evidence_limit_db_s / max(config.evidence_offset_db, LEAST_OFFSET_DB)


def _comb_rows(config: ChainConfig) -> int:
    return config.mains_rows if config.mains_hz else 0


def _floor_rows(config: ChainConfig) -> int:
    """Return the number of rows in which a floor settles; 0 if it is learnt or fixed."""
    _, down_db = floor_steps_db(config.noise_floor_rate_db_s, config.sample_rate_hz)
    if config.noise_floor_learnt or not down_db:
        return 0
    return math.ceil(min(FIRST_FLOOR_DB, config.noise_floor_range_db) / down_db)


def _filter_rows(sections: NDArray[np.float64]) -> int:
    step = np.empty(SHORTEST)
    while True:
        _step_response(sections, step)
        size = np.abs(step)
        last = int(np.flatnonzero(size > SETTLED * size.max())[-1])
        # The response has settled if it stays small for as long as it took to become small.
        if last < step.size // 2:
            return last + 1
        step = np.empty(2 * step.size)


@compiled
def _step_response(sections, output):  # type: ignore[no-untyped-def]
    """Write the response of filters, shape (s, 6), to a step from 0 to 1 at the first row."""
    output[:] = 1.0
    for s in range(sections.shape[0]):
        b0, b1, b2 = sections[s, 0], sections[s, 1], sections[s, 2]
        a1, a2 = sections[s, 4], sections[s, 5]
        first = second = 0.0
        for k in range(output.size):
            value = output[k]
            output[k] = b0 * value + first
            first = b1 * value - a1 * output[k] + second
            second = b2 * value - a2 * output[k]
