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

"""The search space: chains around the given one, with both decisions.

A point of the space has no vote and no threshold: one pass of the chain gives the figures of all
votes and thresholds (:mod:`slip_detector.tuning.sweep`), and a trial takes the best. Instead of
values for the noise floors, a point has the way in which they are learnt from the recordings.
"""

import dataclasses
import functools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.parameters.detector import COMMON_MODES, ChainConfig
from slip_detector.parameters.shared_folder import shared_folder
from slip_detector.tuning.sensor import LEAST_RATIO, MAINS_HZ, largest_slip_steps_v, learnt_floors
from slip_detector.tuning.sweep import rounded
from slip_detector.tuning.tracks import Track

Floats = NDArray[np.float64]

#: Edges as shares of the sample rate: lowest and highest low edge of the pass-band, and the
#: highest edge of any band. A pass-band that would end above it becomes a high-pass.
LOWEST_LOW, HIGHEST_LOW, HIGHEST = 1 / 400, 0.3, 0.48

#: Narrowest and widest pass-band in octaves; the paper's has 2.8 octaves.
OCTAVES = (0.5, 6.0)

#: High edge over low edge of the stop-bands below and above the pass-band, as in the paper: 0.5 to
#: 7 Hz and 50 to 180 Hz.
BELOW, ABOVE = 7.0 / 0.5, 180.0 / 50.0

#: Half the width of a stop-band around the mains frequency.
NOTCH_HALF_WIDTH_HZ = 5.0

#: Shortest window, one sample at the paper's rate, and longest.
SHORTEST_WINDOW_S, LONGEST_WINDOW_S = 0.0025, 0.3

STOPBANDS = ('given', 'none', 'below', 'above', 'both')

#: With fewer channels than this the common mode would be mostly signal.
LEAST_SHARING = 3

#: Degrees of the pass-band, besides the given one; for a band-pass an odd one is raised by 1.
DEGREES = (1, 2, 4)

#: Ranges of the parameters of evidence: the factor on the noise floors, in amplitude, how far and
#: how fast they rise, the offset, the cap above it, the limit, and how long an impact is held for.
FLOOR_SCALE, FLOOR_RANGE_DB, FLOOR_RATE_DB_S = (0.1, 10.0), (0.0, 60.0), (0.02, 5.0)
OFFSET_DB, CAP_ABOVE_DB, LIMIT_DB_S = (0.5, 12.0), (1.0, 30.0), (0.02, 5.0)
HOLD_S = (0.05, 1.0)

#: Where the noise floors come from: the given ones; ones that begin at the level learnt at rest;
#: or ones that follow the envelope, but not below the level learnt at rest.
FLOORS = ('given', 'learnt', 'followed')

#: The step that is an impact: the given one, none, or one larger than any step of a slip.
IMPACTS = ('given', 'none', 'above slips')

#: The parameters of a point that only the decision ``mean``, or only ``evidence``, has.
OF_MEAN = ('decision_window_s',)
OF_EVIDENCE = (
    'floors', 'floor_scale', 'floor_range_db', 'floor_rate_db_s', 'evidence_offset_db',
    'cap_above_db', 'evidence_limit_db_s', 'impact', 'impact_channels', 'impact_hold_s',
)  # fmt: skip


@functools.cache
def presets() -> tuple[ChainConfig, ...]:
    """Return the chains of the parameter files that come with the package, the paper's first.

    Examples
    --------
    >>> presets()[0] == ChainConfig()
    True
    """
    files = sorted((shared_folder() / 'config').glob('*.yaml'))
    return (ChainConfig(), *map(ChainConfig.from_yaml, files))


class SearchSpace:
    """The chains that are tried: the given one with other bands, windows, stages and decisions.

    Parameters
    ----------
    given
        The chain that is tuned; parameters that are not searched keep their values.
    tracks
        The recordings to tune on, from which noise floors and the steps of slips are learnt. Not
        needed for chains that have neither.

    Examples
    --------
    >>> space = SearchSpace(ChainConfig())
    >>> point = space.point(ChainConfig())
    >>> point['decision'], point['passband_low_hz'], point['stopbands']
    ('mean', 7.0, 'given')
    >>> space.chain({**point, 'passband_octaves': 3.0, 'stopbands': 'none'}).passband_hz
    (7.0, 56.0)
    """

    def __init__(self, given: ChainConfig, tracks: Sequence[Track] = ()) -> None:
        self._given, self._tracks = given, tracks
        rate = given.sample_rate_hz
        self._highest_hz = HIGHEST * rate
        self._low_hz = (LOWEST_LOW * rate, HIGHEST_LOW * rate)
        self._window_s = (max(SHORTEST_WINDOW_S, 1.0 / rate), LONGEST_WINDOW_S)
        self._hold_s = (max(HOLD_S[0], 1.0 / rate), HOLD_S[1])
        self._exponents = (1, max(4, given.exponent))
        self._degrees = tuple(sorted({given.passband_degree, *DEGREES}))
        self.notches_hz = (0.0, *(f for f in MAINS_HZ if f + NOTCH_HALF_WIDTH_HZ < HIGHEST * rate))
        self._enabled = given.channels - len(given.disabled_channels)
        mains_hz = filter(self._has_whole_periods, MAINS_HZ)
        self.mains_hz = tuple(sorted({0.0, given.mains_hz, *mains_hz}))
        self._common_modes = COMMON_MODES if self._enabled >= LEAST_SHARING else ('none',)
        self._floors = FLOORS if given.decision == 'evidence' else FLOORS[1:]
        self._impacts = IMPACTS if given.impact_v else IMPACTS[1:]

    def distributions(self) -> dict[str, Any]:
        """Return Optuna's distributions by name."""
        from optuna.distributions import (
            CategoricalDistribution,
            FloatDistribution,
            IntDistribution,
        )

        return {
            'decision': CategoricalDistribution(('mean', 'evidence')),
            'passband_low_hz': FloatDistribution(*self._low_hz, log=True),
            'passband_octaves': FloatDistribution(*OCTAVES),
            'passband_degree': CategoricalDistribution(self._degrees),
            'stopbands': CategoricalDistribution(STOPBANDS),
            'notch_hz': CategoricalDistribution(self.notches_hz),
            'mains_hz': CategoricalDistribution(self.mains_hz),
            'exponent': IntDistribution(*self._exponents),
            'envelope_window_s': FloatDistribution(*self._window_s, log=True),
            'decision_window_s': FloatDistribution(*self._window_s, log=True),
            'floors': CategoricalDistribution(self._floors),
            'floor_scale': FloatDistribution(*FLOOR_SCALE, log=True),
            'floor_range_db': FloatDistribution(*FLOOR_RANGE_DB),
            'floor_rate_db_s': FloatDistribution(*FLOOR_RATE_DB_S, log=True),
            'evidence_offset_db': FloatDistribution(*OFFSET_DB),
            'cap_above_db': FloatDistribution(*CAP_ABOVE_DB),
            'evidence_limit_db_s': FloatDistribution(*LIMIT_DB_S, log=True),
            'impact': CategoricalDistribution(self._impacts),
            'impact_channels': IntDistribution(1, self._enabled, log=True),
            'impact_hold_s': FloatDistribution(*self._hold_s, log=True),
            'common_mode': CategoricalDistribution(self._common_modes),
        }

    def chain(self, point: dict[str, Any]) -> ChainConfig:
        """Return the chain of a point, with the given threshold and vote.

        A given threshold that the chain's evidence cannot reach is replaced by half the limit.

        Raises
        ------
        ValueError
            When its parameters contradict each other, or noise floors cannot be learnt.
        """
        low_hz = rounded(point['passband_low_hz'])
        high_hz = rounded(low_hz * 2.0 ** point['passband_octaves'])
        if high_hz > self._highest_hz:
            high_hz = 0.0
        degree = point['passband_degree']
        # A band-pass has an even degree.
        degree += degree % 2 if high_hz else 0
        chain = dataclasses.replace(
            self._given,
            decision='mean',
            passband_hz=(low_hz, high_hz),
            passband_degree=degree,
            stopbands_hz=self._stopbands(point, low_hz, high_hz),
            mains_hz=point['mains_hz'],
            exponent=point['exponent'],
            # A rounded window must not be shorter than a sample.
            envelope_window_s=max(rounded(point['envelope_window_s']), self._window_s[0]),
            common_mode=point['common_mode'],
        )
        if point['decision'] == 'mean':
            window_s = max(rounded(point['decision_window_s']), self._window_s[0])
            return dataclasses.replace(chain, decision_window_s=window_s)
        return dataclasses.replace(chain, **self._of_evidence(point, chain))

    def _of_evidence(self, point: dict[str, Any], chain: ChainConfig) -> dict[str, Any]:
        """Return the parameters of evidence at a point; ``chain`` has all other parameters."""
        given, limit_db_s = self._given, rounded(point['evidence_limit_db_s'])
        offset_db = rounded(point['evidence_offset_db'])
        return {
            'decision': 'evidence',
            **self._of_floors(point, chain),
            'noise_floor_range_db': rounded(point['floor_range_db']),
            'noise_floor_rate_db_s': rounded(point['floor_rate_db_s']),
            'evidence_offset_db': offset_db,
            'evidence_cap_db': rounded(offset_db + point['cap_above_db']),
            'evidence_limit_db_s': limit_db_s,
            'threshold': given.threshold
            if given.threshold < limit_db_s
            else rounded(0.5 * limit_db_s),
            **self._of_impacts(point),
            'impact_hold_s': rounded(point['impact_hold_s']),
        }

    def _of_floors(self, point: dict[str, Any], chain: ChainConfig) -> dict[str, Any]:
        """Return the parameters of the noise floors at a point."""
        given, which = self._given, point['floors']
        scale, power = rounded(point['floor_scale']), 1.0
        if which == 'given':
            floors, power = given.noise_floor, chain.exponent / given.exponent
            made = {}
        else:
            floors = learnt_floors(chain, self._tracks)
            made = {'noise_floor_learnt': which == 'learnt'}
        if scale != 1.0 or power != 1.0:
            factor = scale**chain.exponent
            floors = tuple(rounded(factor * floor**power) for floor in floors)
        return {'noise_floor': floors, **made}

    def _of_impacts(self, point: dict[str, Any]) -> dict[str, Any]:
        """Return the parameters of the step that is an impact at a point."""
        if point['impact'] != 'above slips':
            return {'impact_v': self._given.impact_v if point['impact'] == 'given' else 0.0}
        channels = point['impact_channels']
        step_v = float(self._slip_steps_v[channels - 1])
        return {'impact_v': rounded(LEAST_RATIO * step_v), 'impact_channels': channels}

    @functools.cached_property
    def _slip_steps_v(self) -> Floats:
        return largest_slip_steps_v(self._given, self._tracks)

    def _has_whole_periods(self, mains_hz: float) -> bool:
        """Return whether the mains has whole periods in rows of the given rate."""
        try:
            return dataclasses.replace(self._given, mains_hz=mains_hz).mains_rows > 0
        except ValueError:
            return False

    def _stopbands(
        self, point: dict[str, Any], low_hz: float, high_hz: float
    ) -> tuple[tuple[float, float], ...]:
        """Return the stop-bands beside the pass-band, and the notch."""
        which, mains_hz = point['stopbands'], point['notch_hz']
        pairs = list(self._given.stopbands_hz) if which == 'given' else []
        if which in ('below', 'both'):
            pairs.append((rounded(low_hz / BELOW), low_hz))
        top_hz = min(rounded(ABOVE * high_hz), rounded(self._highest_hz))
        if which in ('above', 'both') and 0.0 < high_hz < top_hz / 1.1:
            pairs.append((high_hz, top_hz))
        if mains_hz:
            pairs.append((mains_hz - NOTCH_HALF_WIDTH_HZ, mains_hz + NOTCH_HALF_WIDTH_HZ))
        return tuple(pairs)

    def point(self, chain: ChainConfig) -> dict[str, Any]:
        """Return the point of the space that is nearest to a chain."""
        low_hz, high_hz = chain.passband_hz
        octaves = math.log2(high_hz / low_hz) if high_hz else OCTAVES[1]
        stopbands = 'both' if chain.stopbands_hz else 'none'
        if chain.stopbands_hz == self._given.stopbands_hz:
            stopbands = 'given'
        degree, offset_db = chain.passband_degree, chain.evidence_offset_db
        mode = chain.common_mode
        return {
            'decision': chain.decision,
            'passband_low_hz': _within(low_hz, self._low_hz),
            'passband_octaves': _within(octaves, OCTAVES),
            'passband_degree': min(self._degrees, key=lambda one: abs(one - degree)),
            'stopbands': stopbands,
            'notch_hz': 0.0,
            'mains_hz': chain.mains_hz if chain.mains_hz in self.mains_hz else 0.0,
            'exponent': int(_within(chain.exponent, self._exponents)),
            'envelope_window_s': _within(chain.envelope_window_s, self._window_s),
            'decision_window_s': _within(chain.decision_window_s, self._window_s),
            'floors': self._floors_of(chain),
            'floor_scale': 1.0,
            'floor_range_db': _within(chain.noise_floor_range_db, FLOOR_RANGE_DB),
            'floor_rate_db_s': _within(chain.noise_floor_rate_db_s, FLOOR_RATE_DB_S),
            'evidence_offset_db': _within(offset_db, OFFSET_DB),
            'cap_above_db': _within(chain.evidence_cap_db - offset_db, CAP_ABOVE_DB),
            'evidence_limit_db_s': _within(chain.evidence_limit_db_s, LIMIT_DB_S),
            'impact': self._impact_of(chain),
            'impact_channels': min(chain.impact_channels, self._enabled),
            'impact_hold_s': _within(chain.impact_hold_s, self._hold_s),
            'common_mode': mode if mode in self._common_modes else 'none',
        }

    def _floors_of(self, chain: ChainConfig) -> str:
        """Return where the noise floors of a chain come from, one of :data:`FLOORS`.

        Floors that are not the given ones belong to another sensor and are replaced by learnt
        ones. Only whether they follow the envelope counts; with the decision ``mean`` they do not.
        """
        if 'given' in self._floors and chain.noise_floor == self._given.noise_floor:
            return 'given'
        followed = chain.decision == 'evidence' and not chain.noise_floor_learnt
        return 'followed' if followed else 'learnt'

    def _impact_of(self, chain: ChainConfig) -> str:
        if not chain.impact_v:
            return 'none'
        which = 'given' if chain.impact_v == self._given.impact_v else 'above slips'
        return which if which in self._impacts else 'none'

    def distance(self, point: dict[str, Any], other: dict[str, Any]) -> float:
        """Return the distance of two points: 1 for another choice, or for a parameter's range.

        The parameters of a decision count only where both points have this decision.
        """
        ranges = {
            'passband_low_hz': self._low_hz,
            'envelope_window_s': self._window_s,
            'decision_window_s': self._window_s,
            'floor_scale': FLOOR_SCALE,
            'floor_rate_db_s': FLOOR_RATE_DB_S,
            'evidence_limit_db_s': LIMIT_DB_S,
            'impact_hold_s': self._hold_s,
        }
        spans = {
            'passband_octaves': OCTAVES[1],
            'passband_degree': max(self._degrees),
            'exponent': self._exponents[1],
            'floor_range_db': FLOOR_RANGE_DB[1],
            'evidence_offset_db': OFFSET_DB[1],
            'cap_above_db': CAP_ABOVE_DB[1],
            'impact_channels': self._enabled,
        }
        left_out = set() if point['decision'] == 'mean' == other['decision'] else {*OF_MEAN}
        if not point['decision'] == 'evidence' == other['decision']:
            left_out |= {*OF_EVIDENCE}
        steps = []
        for name in point.keys() - left_out:
            a, b = point[name], other[name]
            if name in ranges:
                low, high = ranges[name]
                steps.append(math.log(a / b) / math.log(high / low))
            elif name in spans:
                steps.append((a - b) / spans[name])
            else:
                steps.append(float(a != b))
        return math.hypot(*steps)

    def starts(self) -> list[dict[str, Any]]:
        """Return the points where a search begins: the given chain, the paper's, the presets.

        A preset gives bands, windows and the parameters of evidence; noise floors and the steps
        of impacts are learnt from the sensor that is tuned.
        """
        points: list[dict[str, Any]] = []
        for chain in (self._given, *presets()):
            point = self.point(chain)
            points += [] if point in points else [point]
        return points


def _within(value: float, bounds: tuple[float, float]) -> float:
    return min(max(value, bounds[0]), bounds[1])
