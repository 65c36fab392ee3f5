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

"""The problem of a search: what is tuned, on what, and how the result is chosen and judged."""

import dataclasses
import functools
import hashlib
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning.objective import (
    AUC_STEP,
    Candidate,
    CandidateFigures,
    Objective,
)
from slip_detector.tuning.space import SearchSpace
from slip_detector.tuning.tracks import Track, fingerprint

if TYPE_CHECKING:
    from slip_detector.tuning.study import Study

#: The parameters that a search changes in all chains, and those that only one decision has.
SEARCHED = (
    'common_mode', 'mains_hz', 'passband_hz', 'passband_degree', 'stopbands_hz', 'exponent',
    'envelope_window_s', 'decision', 'threshold', 'vote',
)  # fmt: skip
OF_DECISIONS = {
    'mean': ('decision_window_s',),
    'evidence': (
        'noise_floor', 'noise_floor_learnt', 'noise_floor_range_db', 'noise_floor_rate_db_s',
        'evidence_offset_db', 'evidence_cap_db', 'evidence_limit_db_s', 'impact_v',
        'impact_channels', 'impact_hold_s',
    ),
}  # fmt: skip


def searched(chain: ChainConfig) -> dict[str, Any]:
    """Return the parameters of a chain that a search changes, by name, as ROS has them.

    Examples
    --------
    >>> searched(ChainConfig())['decision_window_s']
    0.04
    """
    parameters = chain.to_parameters()
    return {name: parameters[name] for name in (*SEARCHED, *OF_DECISIONS[chain.decision])}


@dataclasses.dataclass(frozen=True)
class Problem:
    """The problem of a search.

    Attributes
    ----------
    tracks : list of Track
        The recordings to tune on.
    given : ChainConfig
        The chain that is tuned.
    figures : CandidateFigures or None
        Figures that must not get worse.
    evaluation : EvaluationConfig
        What counts as detected.
    config : TuneConfig
        The weights of the cost.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> slip = np.arange(760) >= 380
    >>> volts = slip * np.sin(2 * np.pi * 20.0 * np.arange(760) / 380.0)
    >>> rows = Samples.evenly(np.tile(volts, (16, 1)).T, 380.0, slip)
    >>> track = track_of('trial', [rows], sample_rate_hz=380.0)
    >>> problem = Problem([track], ChainConfig(), None, EvaluationConfig(), TuneConfig())
    >>> point = problem.space.point(problem.given)
    >>> [one.chain.vote for one in problem.candidates_at(problem.objective(), point)]
    ['all', 'mean', 1, 2, 3]
    """

    tracks: list[Track]
    given: ChainConfig
    figures: CandidateFigures | None
    evaluation: EvaluationConfig
    config: TuneConfig

    def study_name(self) -> str:
        """Return a name for the study that no other problem has."""
        asked = (
            fingerprint(self.tracks),
            self.given.to_parameters(),
            self.figures,
            self.evaluation.to_parameters(),
            self.config.to_parameters(),
        )
        return f'{self.config.NODE}-{hashlib.sha256(repr(asked).encode()).hexdigest()[:16]}'

    @functools.cached_property
    def space(self) -> SearchSpace:
        """The space that is searched."""
        return SearchSpace(self.given, self.tracks)

    def objective(self) -> Objective:
        """Return the objective, which computes the cost of chains on the tracks."""
        return Objective(self.tracks, self.evaluation, self.config, self.figures)

    def candidates_at(self, objective: Objective, point: dict[str, Any]) -> list[Candidate]:
        """Return the chain at a point of the space with the best threshold for each vote.

        Parameters
        ----------
        objective
            See :meth:`objective`.
        point
            See :meth:`slip_detector.tuning.space.SearchSpace.distributions`.

        Returns
        -------
        list of Candidate
            The cheapest first; empty where the chain cannot be built or is never ON.
        """
        try:
            return objective.best(self.space.chain(point))
        except ValueError:  # no such filter, or no noise
            return []

    def study(self, where: str | None, name: str, seed: int) -> 'Study':
        """Open the study of this problem; see :class:`slip_detector.tuning.study.Study`."""
        from slip_detector.tuning.study import Study

        return Study(where, name, self.space.distributions(), seed)

    def candidates(self, trial: Any) -> list[Candidate]:
        """Return the chains that a finished trial found, one for each vote, cheapest first."""
        return [
            Candidate(
                dataclasses.replace(self.given, **noted['parameters']),
                noted['cost_ms'],
                noted['error_ms'],
                CandidateFigures(**noted['figures']),
            )
            for noted in trial.user_attrs['found']
        ]

    def best(self, study: 'Study') -> Candidate | None:
        """Return the cheapest chain of all; None where no trial found one."""
        found = [self.candidates(trial)[0] for trial in study.trials]
        return min(found, key=lambda one: one.cost_ms, default=None)

    def choice(self, study: 'Study') -> Candidate | None:
        """Return the result of a search; None where no trial found a chain.

        Of all chains whose cost is at most that of the best one plus its error, it is the nearest
        to the given chain. So with few slips, which cannot distinguish a good chain from a lucky
        one, the result stays close to the given chain.
        """
        best = self.best(study)
        if best is None:
            return None
        space = self.space
        given = space.point(self.given)
        nearest, choice = math.inf, best
        for trial in study.trials:
            away = space.distance(trial.params, given)
            for found in self.candidates(trial):
                if found.cost_ms > best.cost_ms + best.error_ms or self._worse(found, best):
                    continue
                distance = math.hypot(away, found.chain.vote != self.given.vote)
                if distance < nearest:
                    nearest, choice = distance, found
        return choice

    def _worse(self, found: Candidate, best: Candidate) -> bool:
        """Return whether a chain is worse than the given one where the best is not.

        Compared are the number of figures that are worse than the given chain's, and the area
        under the ROC curve, which must not be below those of both: as the area is of many rows,
        few slips do not explain a lower one.
        """
        if self.figures is None:
            return False
        areas = [one.auc or 0.0 for one in (found.figures, best.figures, self.figures)]
        return areas[0] < min(areas[1:]) - AUC_STEP or (
            len(found.figures.worse_than(self.figures))
            > len(best.figures.worse_than(self.figures))
        )


class Verdict(NamedTuple):
    """The chain that a search returns.

    Attributes
    ----------
    chain : ChainConfig
        The best chain found, or the given one.
    kept : str
        Why the given chain is kept; empty where it is not.

    Examples
    --------
    >>> from slip_detector import ChainConfig
    >>> Verdict(ChainConfig(threshold=0.7), kept='').chain.threshold
    0.7
    """

    chain: ChainConfig
    kept: str


def judge(problem: Problem, held: Sequence[Track], best: Candidate | None) -> Verdict:
    """Choose between the given chain and the best one found, by the held-out recordings.

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
    >>> import numpy as np
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.parameters import EvaluationConfig, TuneConfig
    >>> from slip_detector.tuning.tracks import track_of
    >>> slip = np.arange(760) >= 380
    >>> volts = slip * np.sin(2 * np.pi * 20.0 * np.arange(760) / 380.0)
    >>> rows = Samples.evenly(np.tile(volts, (16, 1)).T, 380.0, slip)
    >>> track = track_of('trial', [rows], sample_rate_hz=380.0)
    >>> problem = Problem([track], ChainConfig(), None, EvaluationConfig(), TuneConfig())
    >>> judge(problem, [track], best=None).kept
    'no trial found a chain that detects slip'
    """
    given = problem.given
    if best is None:
        return Verdict(given, 'no trial found a chain that detects slip')
    objective = Objective(held, problem.evaluation, problem.config)
    before, after = objective.as_it_is(given), objective.as_it_is(best.chain)
    if not after.cost_ms < before.cost_ms:
        return Verdict(
            given,
            f'on the held-out recordings the best found costs {after.cost_ms:.4g} ms against '
            f'{before.cost_ms:.4g} ms',
        )
    worse = [] if problem.config.trade else after.figures.worse_than(before.figures)
    if worse:
        return Verdict(
            given,
            f'on the held-out recordings the best found has {", ".join(worse)} (trade: true '
            f'in the section {problem.config.NODE} allows that where the cost falls)',
        )
    return Verdict(best.chain, '')
