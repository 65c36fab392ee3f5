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

"""The verdict of a search: the best chain found or the given one, by held-out recordings."""

from collections.abc import Sequence
from typing import NamedTuple

from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.objective import Candidate, Objective
from slip_detector.tuning.problem import Problem
from slip_detector.tuning.tracks import Track


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
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.parameters import EvaluationConfig, TuneConfig
    >>> from slip_detector.tuning.tracks import track_of
    >>> slip = np.arange(760) >= 380
    >>> volts = slip * np.sin(2 * np.pi * 20.0 * np.arange(760) / 380.0)
    >>> rows = LabelledRows(np.tile(volts, (16, 1)).T, truth=slip)
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
