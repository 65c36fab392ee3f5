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

"""The problem of a search: what is tuned, on what, at what cost, and how the result is judged."""

import dataclasses
import functools
import hashlib
import math
import sys
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from slip_detector.chain.filters import evidence_falls_s, settling_rows
from slip_detector.chain.samples import Floats
from slip_detector.evaluation.chance import HALF, saved_by_chance_s, sooner_than_chance
from slip_detector.evaluation.scores import MOTION, REST, ScoreTally
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig, TuneConfig
from slip_detector.parameters.fields import name_list
from slip_detector.recordings.labels import KINDS
from slip_detector.tuning.space import SearchSpace
from slip_detector.tuning.sweep import (
    ThresholdSweep,
    sweep_thresholds,
    thresholds,
    vote_statistics,
    votes_of,
)
from slip_detector.tuning.tracks import Track

#: Figures by name, None where one is not defined: ``coverage`` and those of :func:`.slip_figures`;
#: ``false_alarms_per_minute_off``, the false alarms per minute of rest in which the decision is
#: OFF, as one that is mostly ON has few alarms; and ``auc``, the area under the ROC curve of rows
#: with slip against rows of motion, or, where no motion is known, all rows without slip.
Figures = dict[str, float | None]

#: The cost of a threshold is averaged with those of this many neighbours on each side, which are
#: :data:`slip_detector.tuning.sweep.STEP` apart: from day to day, contact and sensor change
#: the amplitude by about a tenth.
NEIGHBOURS = 3

#: Confidence that is needed to prefer a chain to one nearer to the given chain. It is high, as the
#: best of many chains may be the best by chance.
CONFIDENCE = 0.99

#: Areas under the ROC curve that differ by less than this count as equal.
AUC_STEP = 1e-3

#: Other figures that differ by less than this count as equal, and coverages by less than this.
EQUAL, COVERAGE_STEP = 1e-9, 5e-3

#: Times ON in recordings of a kind that differ by less than this count as equal, in per cent.
ON_STEP = 0.5

#: Factor on the cost of the amount by which a figure is worse than that of the given chain.
WORSE_COUNTS = 10.0

#: The figures that must not get worse: words, unit, whether more is better, and the step up to
#: which two count as equal.
COMPARED = {
    'latency_median_all_ms': ('median latency', ' ms', False, EQUAL),
    'false_alarms_per_minute_off': ('false alarms', ' in a minute of OFF', False, EQUAL),
    'false_time_percent': ('false time', ' %', False, EQUAL),
    'sooner_than_chance': ('sooner than chance', '', True, EQUAL),
    'coverage': ('time of slips that is ON', '', True, COVERAGE_STEP),
    'auc': ('area under the ROC curve', '', True, AUC_STEP),
    **{f'{kind}_on_percent': (f'time ON in {kind}', ' %', False, ON_STEP) for kind in KINDS},
}


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


def worse_than(figures: Figures, other: Figures) -> list[str]:
    """Return a text for each figure that is worse, or not defined where the other's is.

    Only the area under the ROC curve is compared where the other's figures are no better than
    chance. The latency of the slips found is not, as it falls where late slips are missed.

    Examples
    --------
    >>> given = dict.fromkeys(COMPARED, 1.0)
    >>> worse_than({**given, 'sooner_than_chance': 0.9}, given)
    ['sooner than chance 0.9 against 1']
    """
    texts = []
    for name, (words, unit, more_is_better, step) in COMPARED.items():
        figure, its = (_limited(one, name) for one in (figures, other))
        if its is None or (name != 'auc' and not better_than_chance(other)):
            continue
        if figure is None:
            texts.append(f'no {words} defined against {its:.4g}{unit}')
        elif (its - figure if more_is_better else figure - its) > step:
            texts.append(f'{words} {figure:.4g} against {its:.4g}{unit}')
    return texts


def _limited(figures: Figures, name: str) -> float | None:
    """Return a figure as costs have it: that an alarm is before its slip brings nothing."""
    figure = figures[name]
    return max(figure, 0.0) if figure is not None and name.startswith('latency') else figure


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
        """Return its entry in a study, in types of JSON; see :meth:`Problem.candidates`."""
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
        for vote, statistic in vote_statistics(chain, votes_of(chain), self.tracks).items():
            limits = thresholds(chain, statistic, self.tracks)
            if limits.size:
                voted = dataclasses.replace(chain, vote=vote)
                found.append(self._cheapest(voted, statistic, limits, NEIGHBOURS))
        possible = (one for one in found if one.cost_ms < math.inf)
        return sorted(possible, key=lambda one: one.cost_ms)

    def as_it_is(self, chain: ChainConfig) -> Candidate:
        """Return the cost of a chain with its own threshold and vote.

        Raises
        ------
        ValueError
            When the chain cannot be built.
        """
        (statistic,) = vote_statistics(chain, [chain.vote], self.tracks).values()
        return self._cheapest(chain, statistic, np.array([chain.threshold]), neighbours=0)

    def _cheapest(
        self, chain: ChainConfig, statistic: Sequence[Floats], limits: Floats, neighbours: int
    ) -> Candidate:
        """Return a chain with the threshold that, with so many neighbours, costs least."""
        rows = settling_rows(chain)
        sweep = sweep_thresholds(statistic, self.tracks, limits, self.evaluation, rows)
        costs_ms = self._event_costs_ms(sweep) + self._hidden_costs_ms(chain, limits, sweep)
        costs_ms = _with_neighbours(costs_ms, neighbours)
        at = int(np.argmin(costs_ms))
        chain = dataclasses.replace(chain, threshold=float(limits[at]))
        tally = ScoreTally()
        for part, track in zip(statistic, self.tracks, strict=True):
            # The chain divides in the same way, so the scores equal an evaluation's to the bit.
            tally.add(part / chain.threshold, track.kinds)
        counts = tally.collect()
        auc = counts.auc([MOTION] if counts.counts[MOTION].any() else (REST, MOTION))
        lacking = 1.0 - (auc or 0.0)
        if self.figures is not None:
            lacking += WORSE_COUNTS * max((self.figures['auc'] or 0.0) - (auc or 0.0), 0.0)
        cost_ms = float(costs_ms[at]) + self.config.auc_costs_ms * lacking
        figures = sweep.figures(at)
        alarms, on_percent = figures['false_alarms_per_minute'], figures['false_time_percent']
        off = 1.0 - (on_percent or 0.0) / 100.0
        per_minute_off = alarms / off if alarms is not None and off > 0.0 else None
        figures = {**figures, 'false_alarms_per_minute_off': per_minute_off, 'auc': auc}
        return Candidate(chain, cost_ms, self._error_ms(sweep, at), figures)

    def _event_costs_ms(self, sweep: ThresholdSweep) -> Floats:
        """Return the cost of slips and alarms at each of T thresholds, shape (T,).

        It is infinite where no slip or no rest is scored, which says nothing about the chain.
        """
        config, given, scored = self.config, self.figures, sweep.scored
        late_ms = self._late_ms(sweep)
        if not scored.any() or not sweep.rest_s:
            return np.full(late_ms.shape[1], np.inf)
        missed_costs, false_costs = config.missed_costs_ms, config.false_alarm_costs_ms
        leads_s, windows_s = sweep.leads_s[scored], sweep.windows_s[scored]
        rates_hz = sweep.false_alarms / sweep.rest_s
        per_minute = 60.0 * sweep.false_alarms / sweep.rest_s
        percent = 100.0 * (sweep.on_rest_s / sweep.rest_s)
        # Each kind of recordings counts as much as another, however long it was recorded.
        kinds = [one for one in sweep.of_kinds.values() if one[0]]
        mean_per_minute = sum(60.0 * alarms / rest_s for rest_s, alarms, _ in kinds) / len(kinds)
        mean_percent = sum(100.0 * (on_s / rest_s) for rest_s, _, on_s in kinds) / len(kinds)
        # Labels that are not exact may leave no row that certainly slips.
        missed_percent = 100.0 * (1.0 - np.nan_to_num(sweep.coverage, nan=1.0))
        costs = (
            late_ms.mean(axis=0)
            + 1e3 * saved_by_chance_s(leads_s, windows_s, rates_hz, missed_costs / 1e3)
            + false_costs * mean_per_minute
            + config.false_time_costs_ms * mean_percent
            + config.missed_time_costs_ms * missed_percent
        )
        if given is not None and better_than_chance(given):
            latencies_s = sweep.latencies_ms[scored] / 1e3
            sooner = sooner_than_chance(latencies_s, leads_s, windows_s, rates_hz)
            median = np.where(sooner >= HALF, np.median(late_ms, axis=0), missed_costs)
            # Per minute of rest that is OFF; 0 where none is.
            off = np.maximum(1.0 - percent / 100.0, 0.0)
            per_minute_off = np.divide(per_minute, off, out=np.zeros(off.size), where=off > 0.0)
            limits = {name: _limited(given, name) for name in given}
            limit = {name: np.nan if one is None else one for name, one in limits.items()}
            # A figure that is not defined is not worse.
            worse = (
                np.fmax(median - limit['latency_median_all_ms'], 0.0)
                + missed_costs * np.fmax(limit['sooner_than_chance'] - sooner, 0.0)
                + false_costs * np.fmax(per_minute_off - limit['false_alarms_per_minute_off'], 0.0)
                + config.false_time_costs_ms * np.fmax(percent - limit['false_time_percent'], 0.0)
                + config.missed_time_costs_ms
                * np.fmax(missed_percent - 100.0 * (1.0 - limit['coverage']), 0.0)
            )
            for kind, (rest_s, _, on_s) in sweep.of_kinds.items():
                most = limit.get(f'{kind}_on_percent', np.nan) + ON_STEP
                more = np.fmax(100.0 * (on_s / rest_s) - most, 0.0) if rest_s else 0.0
                worse += config.false_time_costs_ms * more
            costs += WORSE_COUNTS * worse
        return np.asarray(costs)

    def _hidden_costs_ms(
        self, chain: ChainConfig, limits: Floats, sweep: ThresholdSweep
    ) -> Floats | float:
        """Return what a chain's memory costs about the ends of slips, where labels hide that.

        Labels by hand say nothing of the rows about their ends, but how long a chain remembers is
        known: the rows of the mains comb and of windows, the time in which evidence falls from its
        limit to a threshold, and that in which it rises there in the loudest slip.
        """
        before_s = after_s = chain.mains_rows / chain.sample_rate_hz + chain.envelope_window_s
        if chain.decision == 'mean':
            rises_s = falls_s = np.full(limits.shape, chain.decision_window_s)
        else:
            rises_s = limits / chain.evidence_cap_db
            over = np.maximum(1.0 - limits / chain.evidence_limit_db_s, 0.0)
            falls_s = evidence_falls_s(chain) * over
        off_s = on_s = slips_s = np.zeros(limits.shape)
        for track in self.tracks:
            accuracy_s, n = track.samples.accuracy_s, len(track.slips)
            off_s = off_s + n * np.minimum(before_s + rises_s, accuracy_s)
            on_s = on_s + n * np.minimum(after_s + falls_s, accuracy_s)
            slips_s = slips_s + sum(b - a for a, b in track.slips) / track.sample_rate_hz
        rest_s, *_ = sweep.of_kinds.get('', (0.0,))
        if not rest_s:
            return 0.0
        config = self.config
        return np.asarray(
            config.false_time_costs_ms * 100.0 * on_s / rest_s
            + config.missed_time_costs_ms * 100.0 * off_s / slips_s
        )

    def _error_ms(self, sweep: ThresholdSweep, at: int) -> float:
        """Return the error of the mean latency by Student's t, at ``CONFIDENCE``.

        A chain whose cost is higher by less than this counts as equally good. With one slip the
        error is the largest float, as JSON has no infinity.
        """
        late_ms = self._late_ms(sweep)[sweep.scored, at]
        if late_ms.size < 2:
            return sys.float_info.max
        # Imported here: what is learnt of rest and of taps does without it.
        from scipy import special

        t = float(special.stdtrit(late_ms.size - 1, 0.5 + CONFIDENCE / 2))
        return t * float(np.std(late_ms, ddof=1)) / math.sqrt(late_ms.size)

    def _late_ms(self, sweep: ThresholdSweep) -> Floats:
        """Return how late each slip is found, from 0 to the cost of a miss; shape (slips, T).

        Slips that begin while a chain settles count as missed, so that a chain does not gain by
        settling for longer.
        """
        costs_ms = self.config.missed_costs_ms
        return np.asarray(np.clip(np.fmin(sweep.latencies_ms, costs_ms), 0.0, costs_ms))

    def _candidate(self, entry: dict[str, Any]) -> Candidate:
        """Return the candidate of an entry in a study; see :meth:`Candidate.as_json`."""
        rest = {name: entry[name] for name in Candidate._fields[1:]}
        return Candidate(dataclasses.replace(self.given, **entry['parameters']), **rest)

    def cheapest_of(self, trials: Iterable[Any], most: int = 1) -> list[Candidate]:
        """Return the cheapest chains of finished trials, each of another trial."""
        found = sorted((trial.user_attrs['found'][0] for trial in trials), key=_cost_ms)
        return [self._candidate(entry) for entry in found[:most]]

    def best_of(self, trials: Iterable[Any]) -> Candidate | None:
        """Return the cheapest chain of finished trials; None where none found one."""
        return next(iter(self.cheapest_of(trials)), None)

    def choice(self, trials: Sequence[Any]) -> Candidate | None:
        """Return the result of a search; None where no trial found a chain.

        Of all chains whose cost is at most that of the best one plus its error, it is the nearest
        to the given chain. So with few slips, which cannot distinguish a good chain from a lucky
        one, the result stays close to the given chain.
        """
        best, space = self.best_of(trials), self.space
        if best is None:
            return None
        given = space.point(self.given)
        as_good = [
            (space.distance(trial.params, given), found)
            for trial in trials
            for entry in trial.user_attrs['found']
            if entry['cost_ms'] <= best.cost_ms + best.error_ms
            and not self._worse(found := self._candidate(entry), best)
        ]
        vote = self.given.vote
        return min(as_good, key=lambda one: math.hypot(one[0], one[1].chain.vote != vote))[1]

    def passed_over(self, choice: Candidate, trials: Iterable[Any]) -> str:
        """Return a sentence on why :meth:`choice` is not the cheapest chain; empty where it is."""
        best, slips = self.best_of(trials), sum(len(track.slips) for track in self.tracks)
        assert best is not None
        if choice.cost_ms <= best.cost_ms:
            return ''
        given, now = searched(self.given), searched(choice.chain)
        names = name_list([name for name in now if now[name] != given.get(name)])
        less = f'{slips} slips less than {best.error_ms:.3g} ms' if slips > 1 else '1 slip any'
        return (
            f'The cheapest chain costs {best.cost_ms:.1f} ms, but with {less} may be chance, '
            f'so the one nearest to the given parameters was judged, at {choice.cost_ms:.1f} ms: '
            f'it differs in {names or "nothing"}'
        )

    def _worse(self, found: Candidate, best: Candidate) -> bool:
        """Return whether a chain is worse than the given one where the best is not.

        Compared are the number of figures that are worse than the given chain's, and the area
        under the ROC curve, which must not be below those of both: as the area is of many rows,
        few slips do not explain a lower one.
        """
        if self.figures is None:
            return False
        worse, of_best = (len(worse_than(one.figures, self.figures)) for one in (found, best))
        areas = [one['auc'] or 0.0 for one in (found.figures, best.figures, self.figures)]
        return worse > of_best or areas[0] < min(areas[1:]) - AUC_STEP


def _cost_ms(entry: dict[str, Any]) -> float:
    return float(entry['cost_ms'])


def _with_neighbours(costs: Floats, neighbours: int) -> Floats:
    """Return the mean of each cost and of the costs of the neighbouring thresholds; shape (T,).

    Nothing is ON from the highest threshold on, so that its cost continues above. What is ON below
    the lowest is not known, so thresholds that lack neighbours there have an infinite cost.
    """
    width = 2 * neighbours + 1
    padded = np.pad(costs, neighbours, mode='edge')
    padded[:neighbours] = np.inf
    return np.asarray(np.convolve(padded, np.full(width, 1.0 / width), 'valid'))


class Verdict(NamedTuple):
    """The chain that a search returns.

    Attributes
    ----------
    chain : ChainConfig
        The best chain found, or the running one.
    kept : str
        Why the running chain is kept; empty where it is not.
    tried : ChainConfig or None
        The best chain found, also where it is not taken; None where none was found.
    cost_ms : float
        Its cost on what was held out.

    Examples
    --------
    >>> from slip_detector import ChainConfig
    >>> Verdict(ChainConfig(threshold=0.7), kept='').chain.threshold
    0.7
    """

    chain: ChainConfig
    kept: str
    tried: ChainConfig | None = None
    cost_ms: float = math.inf


def judge(problem: Problem, held: Sequence[Track], best: Candidate | None) -> Verdict:
    """Choose between the running chain and the best one found, by the held-out recordings.

    The best one is chosen where it costs less on them and where, unless ``trade`` is set, none of
    median latency, ``sooner_than_chance``, false alarms, false time and area under the ROC curve
    is worse.

    Parameters
    ----------
    problem
        The problem of the search.
    held
        The held-out recordings.
    best
        The best chain found; None where none was found.

    Examples
    --------
    >>> judge(Problem([]), [], best=None).kept
    'no trial found a chain that detects slip'
    """
    running = problem.running or problem.given
    if best is None:
        return Verdict(running, 'no trial found a chain that detects slip')
    on_held = dataclasses.replace(problem, tracks=held, figures=None)
    before, after = on_held.as_it_is(running), on_held.as_it_is(best.chain)
    worse = [] if problem.config.trade else worse_than(after.figures, before.figures)
    slips = sum(len(track.slips) for track in held)
    recalls = [one.figures['recall'] or 0.0 for one in (before, after)]
    if recalls[1] < recalls[0] and better_than_chance(before.figures):
        worse.insert(0, f'misses {slips - round(recalls[1] * slips)} of {slips} slips')
    if after.cost_ms > before.cost_ms:
        worse.append(f'a cost of {after.cost_ms:.4g} against {before.cost_ms:.4g} ms')
    if not worse and after.cost_ms < before.cost_ms:
        return Verdict(best.chain, '', best.chain, after.cost_ms)
    how = f'worse: {", ".join(worse)}' if worse else 'no better'
    why = f'on the held-out recordings the best found is {how}'
    return Verdict(running, why, best.chain)
