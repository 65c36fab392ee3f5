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
import hashlib
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from slip_detector.chain.filters import evidence_falls_s, settling_rows
from slip_detector.chain.samples import Floats
from slip_detector.evaluation.events import LASTING, Events, saved_by_chance_s
from slip_detector.parameters import ChainConfig, EvaluationConfig, TuneConfig
from slip_detector.recordings.labels import KINDS
from slip_detector.tuning.sweep import Vote, VoteStatistics, vote_statistics, votes_of
from slip_detector.tuning.tracks import Track

#: Figures by name, None where one is not defined: those of :meth:`.Events.at` and of
#: :meth:`.ScoreCounts.aucs`.
Figures = dict[str, Any]

#: The cost of a threshold is averaged with the costs of this many neighbours on each side, as
#: contact and sensor change the amplitude by about a tenth from day to day. Neighbours are
#: :data:`.sweep.STEP` apart.
NEIGHBOURS = 3

#: Factor on the cost of the amount by which a figure is worse than that of the given chain.
WORSE_COUNTS = 10.0

#: Recordings are left out one at a time, or where there are more, in so many groups.
FOLDS = 8


class Compared(NamedTuple):
    """How a figure of a chain is compared with the same figure of another chain.

    Attributes
    ----------
    weight : str
        The parameter of :class:`.TuneConfig` that a difference costs; empty: 1 ms.
    direction : float
        1 where more is better, -1 where less is.
    step : float
        Figures that differ by no more than this are equal.
    per : float
        How many times a difference of 1 costs the weight.
    """

    weight: str
    direction: float
    step: float
    per: float = 1.0


ON_COSTS = 'false_time_costs_ms'
#: The figures that must not get worse, by name: first what a slip costs, then time ON by kind.
COMPARED = {
    'recall': Compared('missed_costs_ms', 1.0, 1e-9),
    'coverage': Compared('missed_time_costs_ms', 1.0, 0.005, per=100.0),
    'latency_median_all_ms': Compared('', -1.0, 1e-9),
    'false_alarms_per_minute': Compared('false_alarm_costs_ms', -1.0, 1e-9),
    'false_time_percent': Compared(ON_COSTS, -1.0, 1e-9),
    **{f'{kind}_on_percent': Compared(ON_COSTS, -1.0, 0.5) for kind in KINDS},
    'auc': Compared('auc_costs_ms', 1.0, 1e-3),
}


def worse_by(figures: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Floats]:
    """Return by how much each of :data:`COMPARED` is worse than another chain's; 0 or less: not.

    A figure that is not defined for the other chain is left out; one that is not defined for this
    chain alone is NaN. If the other chain is no better than chance, nothing is compared: one that
    is ON for most of the time finds slips too.

    Parameters
    ----------
    figures
        Numbers, or arrays of them of one shape, with NaN or None where one is not defined.
    other
        See :data:`Figures`.
    """
    differences = {}
    for name in COMPARED if beats_chance(other) else ():
        before, now = other[name], np.array(figures[name], np.float64)
        if before is None:
            continue
        if name.startswith('latency'):  # An alarm that comes before its slip brings nothing.
            before, now = max(before, 0.0), np.maximum(now, 0.0)
        differences[name] = COMPARED[name].direction * (before - now)
    # A chain that is ON for less of the rest is by chance ON for less of the slips too. A chain
    # that is ON for much of the rest has few alarms, as an alarm needs an OFF before it.
    on = (np.array(known['false_time_percent'], np.float64) for known in (other, figures))
    less_percent = np.maximum(np.subtract(*map(np.nan_to_num, on)), 0.0)
    if 'coverage' in differences:
        differences['coverage'] = differences['coverage'] - less_percent / 100.0
    if (alarms := differences.get('false_alarms_per_minute')) is not None:
        excused = less_percent > COMPARED['rest_on_percent'].step
        differences['false_alarms_per_minute'] = np.where(excused, 0.0, alarms)
    return differences


def worse_figures(figures: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """Return which of :data:`COMPARED` are worse, or not defined where the other's are.

    See :func:`worse_by`. The latency of the slips found is not compared, as it falls where late
    slips are missed.

    Parameters
    ----------
    figures, other
        Those of this chain and of another, see :data:`Figures`.

    Examples
    --------
    >>> before = {**dict.fromkeys(COMPARED, 1.0), 'sooner_than_chance': 1.0}
    >>> worse_figures({**before, 'recall': 0.9, 'auc': 0.9995}, before)
    ['recall']
    """
    return [
        name
        for name, by in worse_by(figures, other).items()
        if figures[name] is None or by > COMPARED[name].step
    ]


def beats_chance(figures: Mapping[str, Any]) -> bool:
    """Return whether a chain finds slips sooner than decisions that do not depend on slip.

    Parameters
    ----------
    figures
        Those of the chain, see :data:`Figures`.
    """
    return (figures['sooner_than_chance'] or 0.0) > 0.0


def searched_parameters(chain: ChainConfig) -> dict[str, Any]:
    """Return the parameters of a chain that a search changes, by name, as ROS has them.

    Examples
    --------
    >>> searched_parameters(ChainConfig())['decision_window_s']
    0.04
    """
    parameters, decision = chain.to_parameters(), chain.decision
    fields = dataclasses.fields(chain)
    return {f.name: parameters[f.name] for f in fields if decision in f.metadata['searched_with']}


class Candidate(NamedTuple):
    """A chain with its threshold and vote, its cost, and its :data:`Figures`."""

    chain: ChainConfig
    cost_ms: float
    figures: Figures


@dataclasses.dataclass(frozen=True, eq=False)
class Problem:
    """The problem of a search, which gives each chain a cost.

    Attributes
    ----------
    tracks : sequence of Track
        The recordings to tune on, with at least one slip and some time without slip.
    origin : ChainConfig
        The chain with which the search begins.
    figures : dict or None
        Figures of the running chain, which must not get worse.
    evaluation : EvaluationConfig
        What counts as detected.
    config : TuneConfig
        The weights of the cost.
    settling_rows : int
        No chain settles in fewer rows, so that several are scored on the same slips.
    """

    tracks: Sequence[Track]
    origin: ChainConfig = dataclasses.field(default_factory=ChainConfig)
    figures: Figures | None = None
    evaluation: EvaluationConfig = dataclasses.field(default_factory=EvaluationConfig)
    config: TuneConfig = dataclasses.field(default_factory=TuneConfig)
    settling_rows: int = 0

    def study_name(self) -> str:
        """Return a name for the study that no other problem has, however recordings are named."""
        sets = (self.origin, self.evaluation, self.config)
        shapes = [(track.stretches, track.sample_rate_hz) for track in self.tracks]
        known = [each_set.to_parameters() for each_set in sets], self.figures, shapes
        digest = hashlib.sha256(repr(known).encode())
        for track in self.tracks:
            digest.update(np.ascontiguousarray(track.volts).data)
            digest.update(track.row_classes.data)
            digest.update(track.kind.encode())
        return f'{self.config.NODE}-{digest.hexdigest()[:16]}'

    def best(self, chain: ChainConfig) -> Candidate | None:
        """Return a chain with the threshold and vote that cost least.

        None where it is never ON, or where no slip or no rest is scored.

        Raises
        ------
        ValueError
            When the chain cannot be built.
        """
        candidates = []
        for statistics in self._statistics(chain, votes_of(chain)):
            limits = statistics.thresholds()
            if limits.size:
                candidates.append(self._cheapest(statistics, limits, NEIGHBOURS))
        best = min(candidates, key=lambda candidate: candidate.cost_ms, default=None)
        return best if best and best.cost_ms < math.inf else None

    def evaluate(self, chain: ChainConfig) -> Candidate:
        """Return the cost of a chain with its own threshold and vote."""
        (statistics,) = self._statistics(chain, [chain.vote])
        return self._cheapest(statistics, np.array([chain.threshold]), neighbours=0)

    def _statistics(self, chain: ChainConfig, votes: Sequence[Vote]) -> list[VoteStatistics]:
        """Return the statistics of a chain with each vote."""
        rows = max(settling_rows(chain), self.settling_rows)
        return vote_statistics(chain, votes, self.tracks, self.evaluation, rows)

    def _cheapest(self, statistics: VoteStatistics, limits: Floats, neighbours: int) -> Candidate:
        """Return a chain with the threshold that, with so many neighbours, costs least."""
        swept = Events.pooled(statistics.events(limits))
        costs_ms = self._costs_ms(statistics.chain, limits, swept, neighbours)
        at = int(np.argmin(costs_ms))
        chain = dataclasses.replace(statistics.chain, threshold=float(limits[at]))
        areas = statistics.count_scores(chain.threshold).aucs()
        auc = areas['auc'] or 0.0
        before = auc if self.figures is None else self.figures['auc'] or 0.0
        lacking = 1.0 - auc + WORSE_COUNTS * max(before - auc, 0.0)
        cost_ms = float(costs_ms[at]) + self.config.auc_costs_ms * lacking
        return Candidate(chain, cost_ms, {**swept.at(at), **areas})

    def cross_validate(self, chain: ChainConfig) -> tuple[float, Floats]:
        """Return what a chain costs where the threshold for a recording comes from the others.

        Returns
        -------
        cost_ms : float
            Of all recordings, with a threshold each; infinite where too few have slips that are
            scored.
        costs_ms : ndarray, shape (folds,)
            Of all but one recording, or group of :data:`FOLDS`, for the error of the cost.
        """
        (statistics,) = self._statistics(chain, [chain.vote])
        limits, limit = statistics.thresholds(), np.array([chain.threshold])
        count = min(FOLDS, sum(bool(track.slips) for track in self.tracks))
        unknown = math.inf, np.zeros(count)
        if count < 2 or not limits.size:
            return unknown
        # Recordings with slips are spread over the groups.
        order = sorted(range(len(self.tracks)), key=lambda k: not self.tracks[k].slips)
        events = statistics.events(limits)
        folds = [Events.pooled(events[k] for k in order[fold::count]) for fold in range(count)]
        others = [[k for k in range(count) if k != fold] for fold in range(count)]
        held_out_events = []
        for fold, rest in zip(folds, others, strict=True):
            pooled = Events.pooled(folds[k] for k in rest)
            costs_ms = self._costs_ms(chain, limits, pooled, NEIGHBOURS)
            held_out_events.append(fold.at_one(int(np.argmin(costs_ms))))
        auc = statistics.count_scores(chain.threshold).aucs()['auc']
        lacking_ms = self.config.auc_costs_ms * (1.0 - (auc or 0.0))
        costs = [
            self._costs_ms(chain, limit, Events.pooled(held_out_events[k] for k in part), 0)[0]
            + lacking_ms
            for part in (range(count), *others)
        ]
        return (float(costs[0]), np.array(costs[1:])) if np.isfinite(costs).all() else unknown

    def _costs_ms(
        self, chain: ChainConfig, limits: Floats, swept: Events, neighbours: int
    ) -> Floats:
        """Return the mean cost of each of T thresholds and its neighbours; shape (T,).

        Nothing is ON from the highest threshold on, so that its cost continues above. What is ON
        below the lowest threshold is not known, so thresholds without neighbours there have an
        infinite cost.
        """
        costs_ms = self._event_costs_ms(swept) + self._memory_costs_ms(chain, limits)
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
        costs_ms = (
            late_ms.mean(axis=0)
            + 1e3 * saved_by_chance_s(*chance, most_ms / 1e3)
            + config.false_alarm_costs_ms * 60.0 * _sum_over_kinds(swept, 2)
            + config.false_time_costs_ms * 100.0 * _sum_over_kinds(swept, 1)
            + config.missed_time_costs_ms * missed_percent
        )
        late = {'latency_median_all_ms': np.fmin(figures['latency_median_all_ms'], most_ms)}
        worse = worse_by({**figures, **late, 'auc': np.nan}, self.figures) if self.figures else {}
        for name, by in worse.items():
            weight, _, step, per = COMPARED[name]
            over = np.maximum(np.nan_to_num(by) - step, 0.0)
            costs_ms = costs_ms + WORSE_COUNTS * (per * getattr(config, weight, 1.0)) * over
        return np.asarray(costs_ms)

    def _memory_costs_ms(self, chain: ChainConfig, limits: Floats) -> Floats | float:
        """Return what a chain's memory costs about the ends of slips, where labels hide that.

        Labels by hand say nothing about the rows around their ends. But how long a chain remembers
        is known: the rows of the mains comb and of windows, the time in which evidence falls from
        its limit to a threshold, and the time in which it rises to that in the loudest slip.
        """
        with_slips = [track for track in self.tracks if track.slips]
        rest_s = sum(track.without_slip_s for track in with_slips)
        if not rest_s or not any(track.samples.accuracy_s for track in with_slips):
            return 0.0
        holds_s = chain.mains_rows / chain.sample_rate_hz + chain.envelope_window_s
        if chain.decision == 'mean':
            rises_s = falls_s = np.full(limits.shape, chain.decision_window_s)
        else:
            rises_s = limits / chain.evidence_cap_db
            over = np.maximum(1.0 - limits / chain.evidence_limit_db_s, 0.0)
            falls_s = evidence_falls_s(chain) * over
        off_s, on_s, slips_s = np.zeros(limits.shape), np.zeros(limits.shape), 0.0
        for track in with_slips:
            slips, inexact_s = len(track.slips), track.samples.accuracy_s
            off_s += slips * np.minimum(holds_s + rises_s, inexact_s)
            on_s += slips * np.minimum(holds_s + falls_s, inexact_s)
            slips_s += sum(end - start for start, end in track.slips) / track.sample_rate_hz
        return np.asarray(
            self.config.false_time_costs_ms * 100.0 * on_s / rest_s
            + self.config.missed_time_costs_ms * 100.0 * off_s / slips_s
        )


def _sum_over_kinds(swept: Events, what: int) -> Floats:
    """Return the share of rest that is ON (1), or its alarms a second (2), over kinds; shape (T,).

    The share of rest is added to the mean share of the other kinds of recordings. So rest counts
    as much as all kinds together, and each kind as much as any other, however long it lasts.
    """
    first = LASTING.index('rest') + 1
    parts = swept.lasting[1:first], swept.lasting[first:]  # the rest and the other kinds
    shares = ([kind[what] / kind[0] for kind in part if kind[0].all()] for part in parts)
    return np.asarray(sum(np.mean(part, axis=0) for part in shares if part))
