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

"""The problem of a search: what is tuned, on what, and what a chain costs."""

import dataclasses
import functools
import hashlib
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from slip_detector.chain.filters import evidence_falls_s, settling_rows
from slip_detector.chain.samples import Floats
from slip_detector.evaluation.events import LASTING, Events, saved_by_chance_s
from slip_detector.evaluation.scores import SLIP
from slip_detector.parameters import ChainConfig, EvaluationConfig, TuneConfig
from slip_detector.recordings.labels import KINDS
from slip_detector.tuning import sweep
from slip_detector.tuning.space import SearchSpace
from slip_detector.tuning.tracks import Track

#: Figures by name, None where one is not defined: those of :meth:`.Events.at` and of
#: :meth:`.ScoreCounts.aucs`.
Figures = dict[str, Any]

#: The cost of a threshold is averaged with those of this many neighbours on each side, which are
#: :data:`slip_detector.tuning.sweep.STEP` apart: from day to day, contact and sensor change
#: the amplitude by about a tenth.
NEIGHBOURS = 3

#: Factor on the cost of the amount by which a figure is worse than that of the given chain.
WORSE_COUNTS = 10.0

#: Recordings are left out one at a time, or where there are more, in so many groups.
FOLDS = 8


class Compared(NamedTuple):
    """A figure that must not get worse.

    Attributes
    ----------
    sign : float
        1 where more is better, -1 where less is.
    step : float
        Up to this difference two are equal.
    cost : str
        The weight, see :class:`.TuneConfig`, of a difference of 1 / ``per``.
    per : float
    """

    sign: float
    step: float
    cost: str
    per: float = 1.0


ON = 'false_time_costs_ms'
#: The figures that must not get worse, by name: first what a slip costs, then time ON by kind.
COMPARED = {
    'recall': Compared(1.0, 1e-9, 'missed_costs_ms'),
    'coverage': Compared(1.0, 0.005, 'missed_time_costs_ms', 100.0),
    'latency_median_all_ms': Compared(-1.0, 1e-9, ''),
    'false_alarms_per_minute': Compared(-1.0, 1e-9, 'false_alarm_costs_ms'),
    'false_time_percent': Compared(-1.0, 1e-9, ON),
    **{f'{kind}_on_percent': Compared(-1.0, 0.5, ON) for kind in KINDS},
    'auc': Compared(1.0, 1e-3, 'auc_costs_ms'),
}


def worse_by(figures: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Floats]:
    """Return by how much each of :data:`COMPARED` is worse than another chain's; 0 or less: not.

    A figure that the other chain lacks is left out; one that this chain alone lacks is NaN.
    Only the area under the ROC curve is compared where the other chain is no better than chance.
    What is ON for much of the rest is ON in slips by chance and has few alarms: coverage may fall
    by as much as the time ON, and alarms are not compared where that is less.

    Parameters
    ----------
    figures
        Numbers, or arrays of them of one shape, with NaN or None where one is not defined.
    other
        See :data:`Figures`.
    """
    found = {}
    on_percent, its_percent = (
        np.nan_to_num(np.array(one['false_time_percent'], np.float64)) for one in (figures, other)
    )
    less_percent = np.maximum(its_percent - on_percent, 0.0)
    for name, compared in COMPARED.items():
        its = other[name]
        if its is None or (name != 'auc' and not better_than_chance(other)):
            continue
        figure = np.array(figures[name], np.float64)
        if name.startswith('latency'):  # That an alarm is before its slip brings nothing.
            figure, its = np.maximum(figure, 0.0), max(its, 0.0)
        by = compared.sign * (its - figure)
        if name == 'coverage':
            by = by - less_percent / 100.0
        elif name == 'false_alarms_per_minute':
            by = np.where(less_percent > COMPARED['rest_on_percent'].step, 0.0, by)
        found[name] = by
    return found


def worse_figures(figures: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """Return which of :data:`COMPARED` are worse, or not defined where the other's are.

    See :func:`worse_by`. The latency of the slips found is not compared, as it falls where late
    slips are missed.

    Parameters
    ----------
    figures, other
        See :data:`Figures`.

    Examples
    --------
    >>> given = {**dict.fromkeys(COMPARED, 1.0), 'sooner_than_chance': 1.0}
    >>> worse_figures({**given, 'recall': 0.9, 'auc': 0.9995}, given)
    ['recall']
    """
    return [
        name
        for name, by in worse_by(figures, other).items()
        if figures[name] is None or by > COMPARED[name].step
    ]


def searched(chain: ChainConfig) -> dict[str, Any]:
    """Return the parameters of a chain that a search changes, by name, as ROS has them.

    Examples
    --------
    >>> searched(ChainConfig())['decision_window_s']
    0.04
    """
    parameters, decision = chain.to_parameters(), chain.decision
    fields = dataclasses.fields(chain)
    return {f.name: parameters[f.name] for f in fields if decision in f.metadata['searched_with']}


def better_than_chance(figures: Mapping[str, Any]) -> bool:
    """Return whether a chain finds slips sooner than decisions that do not depend on slip."""
    return (figures['sooner_than_chance'] or 0.0) > 0.0


class Candidate(NamedTuple):
    """A chain with its threshold and vote, and its cost.

    Attributes
    ----------
    chain : ChainConfig
    cost_ms : float
    figures : dict
        See :data:`Figures`.
    """

    chain: ChainConfig
    cost_ms: float
    figures: Figures

    def as_json(self) -> dict[str, Any]:
        """Return its entry in a study, in types of JSON; see :meth:`Problem.candidate`."""
        entry = self._asdict()
        return {'parameters': searched(entry.pop('chain')), **entry}


@dataclasses.dataclass(frozen=True, eq=False)
class Problem:
    """The problem of a search, which gives each chain a cost.

    Attributes
    ----------
    tracks : sequence of Track
        The recordings to tune on, with at least one slip and some time without slip.
    given : ChainConfig
        The chain that is tuned.
    figures : dict or None
        Figures that must not get worse.
    evaluation : EvaluationConfig
        What counts as detected.
    config : TuneConfig
        The weights of the cost.
    running : ChainConfig or None
        The chain that the result has to be better than; None: the given one.
    settling_rows : int
        No chain settles in fewer rows, so that several are scored on the same slips.

    Examples
    --------
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> slip = np.arange(760) >= 380
    >>> volts = slip * np.sin(2 * np.pi * 20.0 * np.arange(760) / 380.0)
    >>> rows = Samples.evenly(np.tile(volts, (16, 1)).T, 380.0, truth=slip)
    >>> problem = Problem([track_of('trial', [rows], sample_rate_hz=380.0)])
    >>> given = problem.as_it_is(problem.given)
    >>> given.figures['sooner_than_chance'], given.figures['false_alarms_per_minute']
    (1.0, 0.0)
    >>> [one.chain.vote for one in problem.candidates_at(problem.space.point(problem.given))]
    ['all', 'mean', 2, 3]
    """

    tracks: Sequence[Track]
    given: ChainConfig = dataclasses.field(default_factory=ChainConfig)
    figures: Figures | None = None
    evaluation: EvaluationConfig = dataclasses.field(default_factory=EvaluationConfig)
    config: TuneConfig = dataclasses.field(default_factory=TuneConfig)
    running: ChainConfig | None = None
    settling_rows: int = 0

    def study_name(self) -> str:
        """Return a name for the study that no other problem has, however recordings are named."""
        sets = (self.given, self.evaluation, self.config, self.running or self.given)
        shapes = [(track.stretches, track.sample_rate_hz) for track in self.tracks]
        asked = ([one.to_parameters() for one in sets], self.figures, shapes)
        digest = hashlib.sha256(repr(asked).encode())
        for track in self.tracks:
            digest.update(np.ascontiguousarray(track.volts).data)
            digest.update(track.kinds.data)
            digest.update(track.kind.encode())
        return f'{self.config.NODE}-{digest.hexdigest()[:16]}'

    @functools.cached_property
    def space(self) -> SearchSpace:
        """The space that is searched."""
        return SearchSpace(self.given, self.tracks)

    def candidates_at(self, point: dict[str, Any]) -> list[Candidate]:
        """Return the chain at a point of the space with the best threshold for each vote.

        Parameters
        ----------
        point
            See :attr:`slip_detector.tuning.space.SearchSpace.distributions`.

        Returns
        -------
        list of Candidate
            The cheapest first; empty where the chain cannot be built or is never ON.
        """
        try:
            return self.best(self.space.chain(point))
        except ValueError:  # no such filter, or no noise
            return []

    def best(self, chain: ChainConfig) -> list[Candidate]:
        """Return a chain with the best threshold for each vote, the cheapest vote first.

        Votes with which the chain is never ON are left out, and all where no slip or no rest is
        scored.

        Raises
        ------
        ValueError
            When the chain cannot be built.
        """
        found = []
        of_votes = sweep.vote_statistics(chain, sweep.votes_of(chain), self.tracks)
        for vote, parts in of_votes.items():
            voted, limits = dataclasses.replace(chain, vote=vote), sweep.thresholds(chain, parts)
            found += [self._cheapest(voted, parts, limits, NEIGHBOURS)] if limits.size else []
        usable = [one for one in found if one.cost_ms < math.inf]
        return sorted(usable, key=lambda one: one.cost_ms)

    def as_it_is(self, chain: ChainConfig) -> Candidate:
        """Return the cost of a chain with its own threshold and vote.

        Raises
        ------
        ValueError
            When the chain cannot be built.
        """
        parts = sweep.vote_statistics(chain, [chain.vote], self.tracks)[chain.vote]
        return self._cheapest(chain, parts, np.array([chain.threshold]), neighbours=0)

    def _cheapest(
        self, chain: ChainConfig, parts: Sequence[sweep.Part], limits: Floats, neighbours: int
    ) -> Candidate:
        """Return a chain with the threshold that, with so many neighbours, costs least."""
        scoring = self._scoring(chain)
        swept = Events.pooled(sweep.sweep_thresholds(parts, limits, *scoring))
        costs_ms = self._costs_ms(chain, limits, swept, neighbours)
        at = int(np.argmin(costs_ms))
        chain = dataclasses.replace(chain, threshold=float(limits[at]))
        areas = sweep.count_scores(parts, chain.threshold, *scoring).aucs()
        auc = areas['auc'] or 0.0
        before = auc if self.figures is None else self.figures['auc'] or 0.0
        lacking = 1.0 - auc + WORSE_COUNTS * max(before - auc, 0.0)
        cost_ms = float(costs_ms[at]) + self.config.auc_costs_ms * lacking
        return Candidate(chain, cost_ms, {**swept.at(at), **areas})

    def _scoring(self, chain: ChainConfig) -> tuple[EvaluationConfig, int]:
        """Return what counts as detected, and in how many rows a chain settles."""
        return self.evaluation, max(settling_rows(chain), self.settling_rows)

    def left_out(self, chain: ChainConfig) -> tuple[float, Floats]:
        """Return what a chain costs where the threshold for a recording comes from the others.

        Returns
        -------
        cost_ms : float
            Of all recordings, with a threshold each; infinite where too few have slips that are
            scored.
        costs_ms : ndarray, shape (folds,)
            Of all but one recording, or group of :data:`FOLDS`, for the error of the cost.
        """
        parts = sweep.vote_statistics(chain, [chain.vote], self.tracks)[chain.vote]
        limits = sweep.thresholds(chain, parts)
        # Recordings with slips are spread over the groups.
        order = sorted(range(len(self.tracks)), key=lambda k: not self.tracks[k].slips)
        many = min(FOLDS, sum(bool(track.slips) for track in self.tracks))
        if many < 2 or not limits.size:
            return math.inf, np.zeros(many)
        scoring = self._scoring(chain)
        of_tracks = sweep.sweep_thresholds(parts, limits, *scoring)
        areas = sweep.count_scores(parts, chain.threshold, *scoring).aucs()
        folds = [Events.pooled(of_tracks[k] for k in order[fold::many]) for fold in range(many)]
        others = [[k for k in range(many) if k != fold] for fold in range(many)]
        alone = []
        for fold, rest in zip(folds, others, strict=True):
            pooled = Events.pooled(folds[k] for k in rest)
            costs_ms = self._costs_ms(chain, limits, pooled, NEIGHBOURS)
            alone.append(fold.at_one(int(np.argmin(costs_ms))))
        limit = np.array([chain.threshold])
        lacking_ms = self.config.auc_costs_ms * (1.0 - (areas['auc'] or 0.0))
        found = [
            self._costs_ms(chain, limit, Events.pooled(alone[k] for k in which), 0)[0] + lacking_ms
            for which in (range(many), *others)
        ]
        if not np.isfinite(found).all():
            return math.inf, np.zeros(many)
        return float(found[0]), np.array(found[1:])

    def _costs_ms(
        self, chain: ChainConfig, limits: Floats, swept: Events, neighbours: int
    ) -> Floats:
        """Return the mean cost of each of T thresholds and its neighbours; shape (T,).

        Nothing is ON from the highest threshold on, so that its cost continues above. What is ON
        below the lowest is not known, so thresholds that lack neighbours there have an infinite
        cost.
        """
        costs_ms = self._event_costs_ms(swept) + self._hidden_costs_ms(chain, limits)
        padded, width = np.pad(costs_ms, neighbours, mode='edge'), 2 * neighbours + 1
        padded[:neighbours] = np.inf
        return np.asarray(np.convolve(padded, np.full(width, 1.0 / width), 'valid'))

    def _event_costs_ms(self, swept: Events) -> Floats:
        """Return the cost of slips and alarms at each of T thresholds, shape (T,).

        It is infinite where no slip or no rest is scored, which says nothing about the chain.
        """
        config, figures, most_ms = self.config, swept.figures, self.config.missed_costs_ms
        rest_s, _, alarms = swept.rest
        if not len(swept.latencies_ms) or not rest_s.all():
            return np.full(rest_s.shape, np.inf)
        late_ms = np.clip(np.fmin(swept.latencies_ms, most_ms), 0.0, most_ms)
        # A slip that begins while a chain settles counts as missed, so that a chain does not gain
        # by settling for longer.
        late_ms = np.pad(late_ms, ((0, swept.settling), (0, 0)), constant_values=most_ms)
        chance = swept.leads_s, swept.windows_s, alarms / rest_s
        # Labels that are not exact may leave no row that certainly slips.
        missed_percent = 100.0 * (1.0 - np.nan_to_num(figures['coverage'], nan=1.0))
        costs = (
            late_ms.mean(axis=0)
            + 1e3 * saved_by_chance_s(*chance, most_ms / 1e3)
            + config.false_alarm_costs_ms * 60.0 * _of_kinds(swept, 2)
            + config.false_time_costs_ms * 100.0 * _of_kinds(swept, 1)
            + config.missed_time_costs_ms * missed_percent
        )
        if self.figures is None:
            return np.asarray(costs)
        late = {'latency_median_all_ms': np.fmin(figures['latency_median_all_ms'], most_ms)}
        for name, by in worse_by({**figures, **late, 'auc': np.nan}, self.figures).items():
            compared = COMPARED[name]
            weight = compared.per * getattr(config, compared.cost, 1.0)
            over = np.nan_to_num(by) - compared.step
            costs = costs + WORSE_COUNTS * weight * np.maximum(over, 0.0)
        return np.asarray(costs)

    def _hidden_costs_ms(self, chain: ChainConfig, limits: Floats) -> Floats | float:
        """Return what a chain's memory costs about the ends of slips, where labels hide that.

        Labels by hand say nothing of the rows about their ends, but how long a chain remembers is
        known: the rows of the mains comb and of windows, the time in which evidence falls from its
        limit to a threshold, and that in which it rises there in the loudest slip.
        """
        with_slips = [track for track in self.tracks if track.slips]
        rest_s = sum((one.kinds < SLIP).sum() / one.sample_rate_hz for one in with_slips)
        if not rest_s or not any(track.samples.accuracy_s for track in with_slips):
            return 0.0
        holds_s = chain.mains_rows / chain.sample_rate_hz + chain.envelope_window_s
        if chain.decision == 'mean':
            rises_s = falls_s = np.full(limits.shape, chain.decision_window_s)
        else:
            rises_s = limits / chain.evidence_cap_db
            over = np.maximum(1.0 - limits / chain.evidence_limit_db_s, 0.0)
            falls_s = evidence_falls_s(chain) * over
        inexact = [(len(track.slips), track.samples.accuracy_s) for track in with_slips]
        off_s, on_s = (
            sum(slips * np.minimum(holds_s + more_s, by_s) for slips, by_s in inexact)
            for more_s in (rises_s, falls_s)
        )
        of_slips = ((sum(b - a for a, b in one.slips), one.sample_rate_hz) for one in with_slips)
        slips_s = sum(rows / rate_hz for rows, rate_hz in of_slips)
        return np.asarray(
            self.config.false_time_costs_ms * 100.0 * on_s / rest_s
            + self.config.missed_time_costs_ms * 100.0 * off_s / slips_s
        )

    def candidate_of(self, trial: Any) -> Candidate:
        """Return the cheapest candidate of a trial; see :meth:`Candidate.as_json`."""
        entry = trial.user_attrs['found'][0]
        rest = {name: entry[name] for name in Candidate._fields[1:]}
        return Candidate(dataclasses.replace(self.given, **entry['parameters']), **rest)


def _of_kinds(swept: Events, what: int) -> Floats:
    """Return the share of rest that is ON (1), or its alarms a second (2), over kinds; shape (T,).

    It is that of rest plus the mean of those of the other kinds of recordings: rest counts as much
    as all others together, and each of these as another, however long it is.
    """
    first = LASTING.index('rest') + 1
    parts = swept.lasting[1:first], swept.lasting[first:]  # the rest and the other kinds
    shares = ([of[what] / of[0] for of in part if of[0].all()] for part in parts)
    return np.asarray(sum(np.mean(part, axis=0) for part in shares if part))
