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
import sys
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from slip_detector.chain.filters import evidence_falls_s, settling_rows
from slip_detector.chain.samples import Floats
from slip_detector.evaluation.chance import HALF, saved_by_chance_s, sooner_than_chance
from slip_detector.parameters import ChainConfig, EvaluationConfig, TuneConfig
from slip_detector.tuning import sweep
from slip_detector.tuning.space import SearchSpace
from slip_detector.tuning.tracks import Track

#: Figures by name, None where one is not defined: ``coverage`` and those of :func:`.slip_figures`
#: and :meth:`.ScoreCounts.aucs`; and ``auc``: ``auc_moving``, or, where that is not defined,
#: ``auc_all``.
Figures = dict[str, Any]

#: The cost of a threshold is averaged with those of this many neighbours on each side, which are
#: :data:`slip_detector.tuning.sweep.STEP` apart: from day to day, contact and sensor change
#: the amplitude by about a tenth.
NEIGHBOURS = 3

#: Confidence that is needed to prefer a chain to one nearer to the given chain. It is high, as the
#: best of many chains may be the best by chance.
CONFIDENCE = 0.99

#: Times ON in recordings of a kind that differ by less than this count as equal, in per cent.
ON_STEP = 0.5

#: Factor on the cost of the amount by which a figure is worse than that of the given chain.
WORSE_COUNTS = 10.0


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


def better_than_chance(figures: Figures) -> bool:
    """Return whether a chain finds slips sooner than decisions that do not depend on slip."""
    return (figures['sooner_than_chance'] or 0.0) > 0.0


class Candidate(NamedTuple):
    """A chain with its threshold and vote, and its cost.

    Attributes
    ----------
    chain : ChainConfig
    cost_ms : float
    error_ms : float
        Half the confidence interval of the mean latency in the cost, by Student's t; large with
        few slips, and the largest float with one.
    figures : dict
        See :data:`Figures`.
    """

    chain: ChainConfig
    cost_ms: float
    error_ms: float
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
    ['all', 'mean', 1, 2, 3]
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
        for vote, statistic in of_votes.items():
            limits = sweep.thresholds(chain, statistic, self.tracks)
            if limits.size:
                voted = dataclasses.replace(chain, vote=vote)
                found.append(self._cheapest(voted, statistic, limits, NEIGHBOURS))
        found.sort(key=lambda one: one.cost_ms)
        return [one for one in found if one.cost_ms < math.inf]

    def as_it_is(self, chain: ChainConfig) -> Candidate:
        """Return the cost of a chain with its own threshold and vote.

        Raises
        ------
        ValueError
            When the chain cannot be built.
        """
        (statistic,) = sweep.vote_statistics(chain, [chain.vote], self.tracks).values()
        return self._cheapest(chain, statistic, np.array([chain.threshold]), neighbours=0)

    def _cheapest(
        self, chain: ChainConfig, statistic: Sequence[Floats], limits: Floats, neighbours: int
    ) -> Candidate:
        """Return a chain with the threshold that, with so many neighbours, costs least."""
        rows = max(settling_rows(chain), self.settling_rows)
        most_ms = self.config.missed_costs_ms
        swept = sweep.sweep_thresholds(statistic, self.tracks, limits, self.evaluation, rows)
        # How late each slip is found. One that begins while a chain settles counts as missed, so
        # that a chain does not gain by settling for longer.
        late_ms = np.clip(np.fmin(swept.latencies_ms, most_ms), 0.0, most_ms)
        hidden_ms = self._hidden_costs_ms(chain, limits, swept)
        costs_ms = _with_neighbours(self._event_costs_ms(swept, late_ms) + hidden_ms, neighbours)
        at = int(np.argmin(costs_ms))
        chain = dataclasses.replace(chain, threshold=float(limits[at]))
        scored = statistic, self.tracks, chain.threshold, self.evaluation, rows
        areas = sweep.count_scores(*scored).aucs()
        auc = areas['auc_all'] if areas['auc_moving'] is None else areas['auc_moving']
        lacking = 1.0 - (auc or 0.0)
        if self.figures is not None:
            lacking += WORSE_COUNTS * max((self.figures['auc'] or 0.0) - (auc or 0.0), 0.0)
        cost_ms = float(costs_ms[at]) + self.config.auc_costs_ms * lacking
        figures = {**swept.figures(at), **areas, 'auc': auc}
        return Candidate(chain, cost_ms, _error_of_mean(late_ms[swept.scored, at]), figures)

    def _event_costs_ms(self, swept: sweep.ThresholdSweep, late_ms: Floats) -> Floats:
        """Return the cost of slips and alarms at each of T thresholds, shape (T,).

        It is infinite where no slip or no rest is scored, which says nothing about the chain.
        """
        config, given, scored = self.config, self.figures, swept.scored
        if not scored.any() or not swept.rest_s:
            return np.full(late_ms.shape[1], np.inf)
        rates_hz = swept.false_alarms / swept.rest_s
        chance = swept.leads_s, swept.windows_s, rates_hz
        # Each kind of recordings counts as much as another, however long it was recorded.
        kinds = {kind: one for kind, one in swept.of_kinds.items() if one[0]}
        per_minute = {kind: 60.0 * many / rest_s for kind, (rest_s, many, _) in kinds.items()}
        on_percent = {kind: 100.0 * (on_s / rest_s) for kind, (rest_s, _, on_s) in kinds.items()}
        # Labels that are not exact may leave no row that certainly slips.
        missed_percent = 100.0 * (1.0 - np.nan_to_num(swept.coverage, nan=1.0))
        costs = (
            late_ms.mean(axis=0)
            + 1e3 * saved_by_chance_s(*chance, config.missed_costs_ms / 1e3)
            + config.false_alarm_costs_ms * (sum(per_minute.values()) / len(kinds))
            + config.false_time_costs_ms * (sum(on_percent.values()) / len(kinds))
            + config.missed_time_costs_ms * missed_percent
        )
        if given is None or not better_than_chance(given):
            return np.asarray(costs)
        # A figure that is not defined is not worse.
        limit = {name: np.nan if one is None else one for name, one in given.items()}
        sooner = sooner_than_chance(swept.latencies_ms[scored] / 1e3, *chance)
        median_ms = np.where(sooner >= HALF, np.median(late_ms, axis=0), config.missed_costs_ms)
        more_percent = 100.0 * (swept.on_rest_s / swept.rest_s) - limit['false_time_percent']
        more_alarms = 60.0 * rates_hz - limit['false_alarms_per_minute']
        more_missed_percent = missed_percent - 100.0 * (1.0 - limit['coverage'])
        # As verdict.worse_than does.
        more = [
            (1.0, median_ms - max(limit['latency_median_all_ms'], 0.0)),
            (config.missed_costs_ms, limit['sooner_than_chance'] - sooner),
            (config.false_alarm_costs_ms, np.where(more_percent < -ON_STEP, 0.0, more_alarms)),
            (config.false_time_costs_ms, more_percent),
            (config.missed_time_costs_ms, more_missed_percent + np.minimum(more_percent, 0.0)),
        ]
        for kind, its_percent in on_percent.items():
            most = limit.get(f'{kind}_on_percent', np.nan) + ON_STEP
            more.append((config.false_time_costs_ms, its_percent - most))
        worse = sum(weight * np.fmax(by, 0.0) for weight, by in more)
        return np.asarray(costs + WORSE_COUNTS * worse)

    def _hidden_costs_ms(
        self, chain: ChainConfig, limits: Floats, swept: sweep.ThresholdSweep
    ) -> Floats | float:
        """Return what a chain's memory costs about the ends of slips, where labels hide that.

        Labels by hand say nothing of the rows about their ends, but how long a chain remembers is
        known: the rows of the mains comb and of windows, the time in which evidence falls from its
        limit to a threshold, and that in which it rises there in the loudest slip.
        """
        rest_s, *_ = swept.of_kinds.get('', (0.0,))
        if not rest_s:
            return 0.0
        holds_s = chain.mains_rows / chain.sample_rate_hz + chain.envelope_window_s
        if chain.decision == 'mean':
            rises_s = falls_s = np.full(limits.shape, chain.decision_window_s)
        else:
            rises_s = limits / chain.evidence_cap_db
            over = np.maximum(1.0 - limits / chain.evidence_limit_db_s, 0.0)
            falls_s = evidence_falls_s(chain) * over
        inexact = [(len(track.slips), track.samples.accuracy_s) for track in self.tracks]
        off_s, on_s = (
            sum(slips * np.minimum(holds_s + more_s, by_s) for slips, by_s in inexact)
            for more_s in (rises_s, falls_s)
        )
        of_slips = ((sum(b - a for a, b in one.slips), one.sample_rate_hz) for one in self.tracks)
        slips_s = sum(rows / rate_hz for rows, rate_hz in of_slips)
        return np.asarray(
            self.config.false_time_costs_ms * 100.0 * on_s / rest_s
            + self.config.missed_time_costs_ms * 100.0 * off_s / slips_s
        )

    def candidate(self, entry: dict[str, Any]) -> Candidate:
        """Return the candidate of an entry in a study; see :meth:`Candidate.as_json`."""
        rest = {name: entry[name] for name in Candidate._fields[1:]}
        return Candidate(dataclasses.replace(self.given, **entry['parameters']), **rest)


def _error_of_mean(late_ms: Floats) -> float:
    """Return the error of the mean latency by Student's t, at ``CONFIDENCE``.

    A chain whose cost is higher by less than this counts as equally good. With one slip the error
    is the largest float, as JSON has no infinity.
    """
    if late_ms.size < 2:
        return sys.float_info.max
    # Imported here: what is learnt of rest and of taps does without it.
    from scipy import special

    t = float(special.stdtrit(late_ms.size - 1, 0.5 + CONFIDENCE / 2))
    return t * float(np.std(late_ms, ddof=1)) / math.sqrt(late_ms.size)


def _with_neighbours(costs: Floats, neighbours: int) -> Floats:
    """Return the mean of each cost and of the costs of the neighbouring thresholds; shape (T,).

    Nothing is ON from the highest threshold on, so that its cost continues above. What is ON below
    the lowest is not known, so thresholds that lack neighbours there have an infinite cost.
    """
    width = 2 * neighbours + 1
    padded = np.pad(costs, neighbours, mode='edge')
    padded[:neighbours] = np.inf
    return np.asarray(np.convolve(padded, np.full(width, 1.0 / width), 'valid'))
