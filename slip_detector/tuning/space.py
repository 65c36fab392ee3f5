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

import contextlib
import dataclasses
import functools
import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from slip_detector.parameters import COMMON_MODES, ChainConfig, shared_folder
from slip_detector.tuning import measuring
from slip_detector.tuning.sweep import round_digits
from slip_detector.tuning.tracks import Track

#: Edges as shares of the sample rate: lowest and highest low edge of the pass-band, and the
#: highest edge of any band. A pass-band that would end above it becomes a high-pass.
LOWEST_LOW, HIGHEST_LOW, HIGHEST = 1 / 400, 0.3, 0.48

#: Most octaves of a pass-band; the paper's has 2.8.
WIDEST = 6.0

#: Shortest window, one sample at the paper's rate.
SHORTEST_WINDOW_S = 0.0025

#: Least offset of evidence. Contact and sensor change the level by some 1 dB from day to day, and
#: that must not become evidence.
LEAST_OFFSET_DB = 2.0

#: With fewer channels than this the common mode would be mostly signal.
LEAST_SHARING = 3

#: Kinds of recordings, and the parameters that are searched only where there is one of them; else
#: nothing shows what the parameters are for, and they stay as they are.
SHOWN_BY_KINDS = (
    ({'taps', 'press', 'roll'}, ('impact_s', 'common_rank')),
    ({'idle'}, ('contact', 'contact_channels')),
    ({'press', 'roll'}, ('activity', 'activity_cap_db', 'activity_range_db')),
)

#: The parameters of stages that a point may have as in the origin, not at all, or learnt or
#: searched. Where the first is 0, there is no such stage.
STAGES = {
    'impact': ('impact_v', 'impact_s', 'impact_channels'),
    'contact': ('contact_level_v', 'contact_channels'),
    'activity': ('activity_cap_db', 'activity_range_db'),
}

#: Prefixes of the names of those parameters of a point that only one decision has.
DECISION_PREFIXES = {
    'mean': ('decision_window',),
    'evidence': ('floor', 'noise', 'evidence', 'cap', 'impact', 'contact', 'activity', 'common_r'),
}

#: With the first number of slips, an impact is twice as large a step as with many. With fewer
#: slips than the second number it is never smaller than the steps of slips, as a slide with larger
#: steps would be taken for impacts.
FEW_SLIPS, MANY_SLIPS = 2, 10

#: Times over which the step of an impact is measured, and its size as a multiple of slips' steps.
IMPACTS_S = (0.0, 0.005, 0.01, 0.02, 0.05)
IMPACT_SCALES = (0.75, 1.5)

#: The cap of activity, how far the floor is below the low level, and the largest rank of common
#: excess.
ACTIVITY_CAP_DB, ACTIVITY_RANGES_DB, MOST_RANK = 8.7, (10.0, 15.0, 20.0), 3

#: What is tried with each band that was measured: windows of the envelope, and decisions. Evidence
#: is that of a vibration or of a slow sensor, alone and together with all that recordings of kinds
#: teach.
WINDOWS_S = (0.05, 0.2)
MEAN = {'decision': 'mean', 'exponent': 1, 'decision_window_s': 0.1}
EVIDENCES = (
    {'decision': 'evidence', 'evidence_offset_db': 3.5, 'evidence_limit_db_s': 1.3},
    {'decision': 'evidence', 'evidence_offset_db': LEAST_OFFSET_DB, 'evidence_limit_db_s': 2.0},
)
LEARNT_IMPACT = {'impact': 'learnt', 'impact_channels': 2}
ACTIVITY = {'activity': 'searched'}

#: Floors that stay near those of rest; and floors that begin anew, and follow within seconds,
#: where the noise of each contact is another.
REST_FLOORS = {'noise_floor_range_db': 15.0, 'noise_floor_rate_db_s': 0.43}
CONTACT_FLOORS = {
    'floors': 'followed',
    'noise_floor_range_db': 60.0,
    'noise_floor_rate_db_s': 3.0,
}
TOGETHER = {
    **LEARNT_IMPACT,
    **ACTIVITY,
    **CONTACT_FLOORS,
    'floor_scale': 0.5,
    'contact': 'learnt',
    'contact_channels': 4,
    'activity_range_db': 15.0,
    'common_rank': 1,
}


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
    origin
        The chain that is tuned; parameters that are not searched keep their values.
    tracks
        The recordings to tune on, from which noise floors and the steps of slips are learnt. Not
        needed for chains that have neither.
    """

    def __init__(self, origin: ChainConfig, tracks: Sequence[Track] = ()) -> None:
        self._origin, self._tracks = origin, tracks
        self._slips = sum(len(track.slips) for track in tracks)
        self._highest_hz = HIGHEST * origin.sample_rate_hz
        self._least_window_s = max(SHORTEST_WINDOW_S, 1.0 / origin.sample_rate_hz)
        # Steps and levels of contact depend on few parameters, and many points share them.
        self._learnt: dict[Any, Any] = {}

    @functools.cached_property
    def distributions(self) -> dict[str, Any]:
        """Optuna's distributions by name."""
        from optuna.distributions import CategoricalDistribution as OneOf
        from optuna.distributions import FloatDistribution as Between
        from optuna.distributions import IntDistribution as Whole

        origin, rate = self._origin, self._origin.sample_rate_hz
        channels = origin.channels - len(origin.disabled_channels)
        window_s = Between(self._least_window_s, 0.3, log=True)
        mains_hz = {0.0, origin.mains_hz}
        for each_hz in measuring.MAINS_HZ:
            with contextlib.suppress(ValueError):  # The rate has no whole periods of it.
                mains_hz.add(dataclasses.replace(origin, mains_hz=each_hz).mains_hz)
        distributions = {
            'impact_s': OneOf(sorted({origin.impact_s, *IMPACTS_S})),
            'common_rank': Whole(0, max(MOST_RANK, origin.common_rank)),
            'contact': OneOf(_ways(origin.contact_level_v, 'none', 'learnt')),
            'contact_channels': Whole(1, channels, log=True),
            'activity': OneOf(_ways(origin.activity_cap_db, 'none', 'searched')),
            'activity_cap_db': Between(2.0, 20.0),
            'activity_range_db': Between(-10.0, 30.0),
            'decision': OneOf(('mean', 'evidence')),
            'passband_low_hz': Between(LOWEST_LOW * rate, HIGHEST_LOW * rate, log=True),
            'passband_octaves': Between(0.5, WIDEST),
            # For a band-pass an odd degree is raised by 1.
            'passband_degree': OneOf(sorted({origin.passband_degree, 1, 2, 4})),
            'stopbands': OneOf(_ways(origin.stopbands_hz, 'none')),
            'mains_hz': OneOf(sorted(mains_hz)),
            'exponent': Whole(1, max(4, origin.exponent)),
            'envelope_window_s': window_s,
            'decision_window_s': window_s,
            # The given floors; ones that begin at the level learnt at rest; or ones that follow
            # the envelope, but not below the level learnt at rest.
            'floors': OneOf(_ways(origin.decision == 'evidence', 'learnt', 'followed')),
            'floor_scale': Between(0.1, 10.0, log=True),  # of the amplitude
            'noise_floor_range_db': Between(0.0, 60.0),
            'noise_floor_rate_db_s': Between(0.02, 5.0, log=True),
            'evidence_offset_db': Between(min(LEAST_OFFSET_DB, origin.evidence_offset_db), 12.0),
            'cap_above_db': Between(1.0, 30.0),
            'evidence_limit_db_s': Between(0.02, 5.0, log=True),
            # The given step that is an impact, none, or one beside the largest steps of slips.
            'impact': OneOf(_ways(origin.impact_v, 'none', 'learnt')),
            'impact_scale': Between(0.2 if self._slips >= MANY_SLIPS else 1.0, 5.0, log=True),
            'impact_channels': Whole(1, channels, log=True),
            'impact_hold_s': Between(max(0.05, 1.0 / rate), 1.0, log=True),
            'common_mode': OneOf(COMMON_MODES if channels >= LEAST_SHARING else ('none',)),
        }
        kinds = {track.kind for track in self._tracks}
        for shown_by, names in SHOWN_BY_KINDS:
            for name in names if not kinds & shown_by else ():
                del distributions[name]
        return distributions

    def chain(self, point: dict[str, Any]) -> ChainConfig:
        """Return the chain of a point, with the given threshold and vote.

        A given threshold that the chain's evidence cannot reach is replaced by half the limit.

        Raises
        ------
        ValueError
            When its parameters contradict each other, or noise floors cannot be learnt.
        """
        origin, decision = self._origin, point['decision']
        low_hz, degree = round_digits(point['passband_low_hz']), point['passband_degree']
        high_hz = round_digits(low_hz * 2.0 ** point['passband_octaves'])
        high_hz = high_hz if high_hz <= self._highest_hz else 0.0
        fields = dataclasses.fields(origin)
        names = {field.name for field in fields if decision in field.metadata['searched_with']}
        changes: dict[str, Any] = {
            name: round_digits(value) if isinstance(value, float) else value
            for name, value in point.items()
            if name in names
        }
        # A rounded window must not be shorter than a sample.
        for name in {'envelope_window_s', 'decision_window_s'} & changes.keys():
            changes[name] = max(changes[name], self._least_window_s)
        changes |= {
            'passband_hz': (low_hz, high_hz),
            'passband_degree': degree + degree % 2 if high_hz else degree,
            'stopbands_hz': origin.stopbands_hz if point['stopbands'] == 'given' else (),
            'mains_hz': point['mains_hz'],
        }
        if decision == 'mean':
            return dataclasses.replace(origin, **changes)
        if origin.threshold >= changes['evidence_limit_db_s']:
            changes['threshold'] = round_digits(0.5 * changes['evidence_limit_db_s'])
        learnt = {'given': origin.noise_floor_learnt, 'learnt': True, 'followed': False}
        changes['noise_floor_learnt'] = learnt[point['floors']]
        changes['evidence_cap_db'] = round_digits(
            changes['evidence_offset_db'] + point['cap_above_db']
        )
        for stage, (switch, *others) in STAGES.items():
            changes |= {name: getattr(origin, name) for name in (switch, *others)}
            if point.get(stage) == 'none':
                changes[switch] = 0.0
        if point['impact'] == 'learnt':
            changes |= self._learn_impact(point)
        if point.get('activity') == 'searched':
            begin_hz, end_hz = origin.activity_band_hz
            begin_hz *= min(low_hz / end_hz, 1.0)
            changes['activity_band_hz'] = round_digits(begin_hz), min(low_hz, end_hz)
            changes |= {name: round_digits(point[name]) for name in STAGES['activity']}
        mean = dataclasses.replace(origin, **{**changes, 'decision': 'mean'})
        if point.get('contact') == 'learnt':
            changes['contact_channels'] = channels = point['contact_channels']
            touched = dataclasses.replace(mean, contact_channels=channels, contact_level_v=0.0)
            changes['contact_level_v'] = self._learn_contact(touched)
        return dataclasses.replace(origin, **changes, noise_floor=self._floors(point, mean))

    def _once(self, key: Any, learn: Callable[[], Any]) -> Any:
        """Return what is learnt, which is the same for the same key."""
        if key not in self._learnt:
            self._learnt[key] = learn()
        return self._learnt[key]

    def _learn_contact(self, chain: ChainConfig) -> float:
        """Return the level of contact of a chain."""
        key = chain.contact_channels, chain.activity_band_hz, chain.envelope_window_s
        learn = functools.partial(measuring.contact_level_v, chain, self._tracks)
        return float(self._once((*key, chain.common_mode), learn))

    def _floors(self, point: dict[str, Any], chain: ChainConfig) -> tuple[float, ...]:
        """Return the noise floors at a point; ``chain`` has all other parameters."""
        scale, power = round_digits(point['floor_scale']), 1.0
        if point['floors'] == 'given':
            floors, power = chain.noise_floor, chain.exponent / self._origin.exponent
        else:
            floors = measuring.learn_floors(chain, self._tracks)
        if scale == power == 1.0:
            return floors
        return tuple(round_digits(scale**chain.exponent * floor**power) for floor in floors)

    def _learn_impact(self, point: dict[str, Any]) -> dict[str, Any]:
        """Return the parameters of an impact, whose step is beside those of slips."""
        impact_s, channels = point.get('impact_s', self._origin.impact_s), point['impact_channels']
        rows = self._origin.samples(impact_s)
        learn = functools.partial(measuring.slip_steps_v, self._origin, self._tracks, rows)
        step_v = float(self._once(rows, learn)[channels - 1])
        # The largest step of few slips says little of the next one's.
        few = 1.0 + FEW_SLIPS / max(self._slips, 1)
        impact_v = round_digits(point['impact_scale'] * few * step_v)
        return {'impact_v': impact_v, 'impact_s': impact_s, 'impact_channels': channels}

    def point(self, chain: ChainConfig) -> dict[str, Any]:
        """Return the point of the space that is nearest to a chain.

        Noise floors and an impact that are not the given ones belong to another sensor, and are
        replaced by learnt ones. Where the floors of the chain follow the envelope, the learnt ones
        do too; with the decision ``mean`` they do not.
        """
        origin = self._origin
        followed = chain.decision == 'evidence' and not chain.noise_floor_learnt
        floors = 'followed' if followed else 'learnt'
        if origin.decision == 'evidence' and chain.noise_floor == origin.noise_floor:
            floors = 'given'

        def way(value: float, in_origin: bool, other: str = 'learnt') -> str:
            return 'none' if not value else 'given' if in_origin else other

        # All others have the names of the chain's parameters.
        values = vars(chain) | {
            **_band(chain.passband_hz),
            'stopbands': 'given' if chain.stopbands_hz == origin.stopbands_hz else 'none',
            'floors': floors,
            'floor_scale': 1.0,
            'cap_above_db': chain.evidence_cap_db - chain.evidence_offset_db,
            'impact': way(chain.impact_v, chain.impact_v == origin.impact_v),
            'impact_scale': IMPACT_SCALES[-1],
            'contact': way(chain.contact_level_v, chain == origin),
            'activity': way(chain.activity_cap_db, chain == origin, 'searched'),
            'activity_cap_db': chain.activity_cap_db or ACTIVITY_CAP_DB,
        }
        return {name: _nearest(among, values[name]) for name, among in self.distributions.items()}

    def distance(self, point: dict[str, Any], other: dict[str, Any]) -> float:
        """Return the distance of two points: 1 for another choice, or for a parameter's range.

        The parameters of a decision count only where both points have this decision.
        """
        decisions, steps = {point['decision'], other['decision']}, []
        left_out = [
            names for decision, names in DECISION_PREFIXES.items() if decisions != {decision}
        ]
        for name, allowed in self.distributions.items():
            a, b = point[name], other[name]
            if any(map(name.startswith, left_out)):
                continue
            if name == 'passband_degree':
                steps.append((a - b) / allowed.choices[-1])
            elif hasattr(allowed, 'choices'):
                steps.append(float(a != b))
            elif allowed.log and name != 'impact_channels':
                steps.append(math.log(a / b) / math.log(allowed.high / allowed.low))
            else:
                steps.append((a - b) / allowed.high)
        return math.hypot(*steps)

    def starts(self) -> list[dict[str, Any]]:
        """Return the points where a search begins: the given chain, the paper's, the presets.

        A preset gives bands, windows and the parameters of evidence; noise floors and the steps
        of impacts are learnt from the sensor that is tuned.
        """
        origin = self.point(self._origin)
        points = [origin, {**origin, 'floors': 'learnt'}]
        for point in map(self.point, presets()):
            points += [] if point in points else [point]
        return points

    def stages(self) -> list[list[dict[str, Any]]]:
        """Return changes of a point, by stage of the chain, in the order in which they are tried.

        First come the bands in which slides stand out from rest, without and with all that the
        recordings of kinds teach; then each of that, and evidence itself.
        """
        allowed = self.distributions
        bands, _ = measuring.slip_bands(self._origin, self._tracks)
        decisions = (MEAN, *EVIDENCES, *({**evidence, **TOGETHER} for evidence in EVIDENCES))
        of_bands = itertools.product(bands, WINDOWS_S, decisions)
        impacts = {'impact_s': IMPACTS_S[::2], 'impact_scale': IMPACT_SCALES}
        stages = [
            [
                {**_band(band), 'stopbands': 'none', 'envelope_window_s': window_s, **decision}
                for band, window_s, decision in of_bands
            ],
            [
                *_each(REST_FLOORS, floors=('learnt', 'followed'), floor_scale=(0.7, 1.0)),
                *_each(CONTACT_FLOORS, floor_scale=(0.25, 0.5), noise_floor_rate_db_s=(1.0, 3.0)),
            ],
            _each({}, mains_hz=allowed['mains_hz'].choices),
            [{'impact': 'none'}, *_each(LEARNT_IMPACT, **impacts)],
            [{'contact': 'none'}, *_each({'contact': 'learnt'}, contact_channels=(1, 2, 4, 6))],
            [{'activity': 'none'}, *_each(ACTIVITY, activity_range_db=ACTIVITY_RANGES_DB)],
            _each({}, common_rank=range(MOST_RANK + 1)),
            _each({}, evidence_offset_db=(LEAST_OFFSET_DB, 3.5, 5.0, 7.0)),
            _each({}, evidence_limit_db_s=(0.3, 0.6, 1.3, 2.6)),
            _each({}, common_mode=allowed['common_mode'].choices),
        ]
        return [
            [
                {name: _nearest(allowed[name], change[name]) for name in change if name in allowed}
                for change in stage
            ]
            for stage in stages
        ]


def _each(others: dict[str, Any], **values: Iterable[Any]) -> list[dict[str, Any]]:
    """Return a change of a point for each combination of values, with others that stay."""
    every = itertools.product(*values.values())
    return [others | dict(zip(values, combination, strict=True)) for combination in every]


def _band(band_hz: tuple[float, float]) -> dict[str, Any]:
    """Return the part of a point that has a pass-band."""
    low_hz, high_hz = band_hz
    octaves = math.log2(high_hz / low_hz) if high_hz else WIDEST
    return {'passband_low_hz': low_hz, 'passband_octaves': octaves}


def _ways(in_origin: object, *others: str) -> tuple[str, ...]:
    """Return the choices of a stage that may stay as in the origin, if that has it."""
    return ('given', *others) if in_origin else others


def _nearest(allowed: Any, value: Any) -> Any:
    """Return the nearest value of a distribution; of choices, what stands for none."""
    if not hasattr(allowed, 'choices'):
        return min(max(value, allowed.low), allowed.high)
    if value in allowed.choices:
        return value
    if isinstance(value, int):
        return min(allowed.choices, key=lambda choice: abs(choice - value))
    return 0.0 if 0.0 in allowed.choices else 'none'
