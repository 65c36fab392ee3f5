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

"""A search against the same search with a chain in SciPy and NumPy; their trials take turns.

Both try only chains that the rival supports: the paper's decision, without a mains comb.
:func:`measure_search` gives one object:

``trials``
    Trials of each search.
``search_s``, ``numpy_s``, ``speedup``
    Processor time of all trials of each search, and their ratio; other load is not counted.
``agreement``
    Share of the trials in which both searches found the same cost.
"""

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from benchmarks.timing import garbage_collection_off
from slip_detector.chain.filters import design, settling_rows
from slip_detector.chain.samples import Samples
from slip_detector.evaluation.matching import ScoredRows
from slip_detector.evaluation.scores import SLIP
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.tuning.problem import Problem
from slip_detector.tuning.search import Study
from slip_detector.tuning.space import SearchSpace
from slip_detector.tuning.sweep import ThresholdSweep, Vote
from slip_detector.tuning.tracks import Track, track_of

Floats = NDArray[np.float64]

#: Costs that differ by less count as equal: rounding differs between the two sides, so a level
#: next to a threshold may be above it for one and below it for the other.
SAME_COST_MS = 0.5

#: At least this share of the trials must have the same cost.
LEAST_AGREEMENT = 0.9

#: Trials of each search, and length of the recording.
TRIALS, MINUTES = 100, 15.0


def slips_and_noise(minutes: float) -> Track:
    """Make a recording of 16 channels at 380 Hz: noise, some hum, and slips of half a second."""
    config = ChainConfig()
    rate, random = config.sample_rate_hz, np.random.default_rng(0)
    n = round(minutes * 60.0 * rate)
    time_s = np.arange(n) / rate
    truth = np.asarray(time_s % 5.0 > 4.5)
    volts = 4.3 + 0.004 * random.standard_normal((n, config.channels))
    volts += 0.002 * np.sin(2 * np.pi * 50.0 * time_s)[:, None]
    ridges = 0.02 * np.sin(2 * np.pi * 17.0 * time_s[:, None] + np.arange(config.channels))
    volts[truth] += ridges[truth]
    return track_of('slips and noise', [Samples.evenly(volts, rate, truth)], rate)


class NumpyProblem(Problem):
    """The problem, with chain and sweep as a user of SciPy and NumPy would write them.

    It does not check the samples, as such scripts do not.
    """

    def statistics(
        self, chain: ChainConfig, votes: Sequence[Vote]
    ) -> Mapping[Vote, Sequence[Floats]]:
        """Return the statistic to compare with the threshold, by vote and track; shapes (n,)."""
        tracks = [_statistics(_level(chain, track.volts), chain, votes) for track in self.tracks]
        return {vote: [one[vote] for one in tracks] for vote in votes}

    def sweep(
        self, chain: ChainConfig, statistic: Sequence[Floats], limits: Floats
    ) -> ThresholdSweep:
        """Return the outcome of the one track, which has no gaps, at each threshold."""
        (part,), (track,) = statistic, self.tracks
        return _sweep(part, limits, track, self.evaluation, settling_rows(chain))

    def auc(self, statistic: Sequence[Floats], threshold: float) -> float | None:
        """Return the area under the ROC curve of rows with slip against all others."""
        score = np.concatenate(statistic)
        slip = np.concatenate([track.kinds == SLIP for track in self.tracks])
        pairs = int(slip.sum()) * int((~slip).sum())
        others = np.sort(score[~slip])
        below = sum(np.searchsorted(others, score[slip], side) for side in ('left', 'right'))
        return float(np.sum(below)) / 2 / pairs if pairs else None


def _sweep(
    part: Floats, limits: Floats, track: Track, config: EvaluationConfig, settling: int
) -> ThresholdSweep:
    """Return the outcome of one track; its windows must not overlap."""
    rate_hz = track.sample_rate_hz
    rows = ScoredRows(
        track.slips,
        [stretch.interval for stretch in track.stretches],
        settling,
        config,
        rate_hz,
    )
    rest = np.zeros(len(part), bool)
    for start, end in zip(rows.rest_starts, rows.rest_ends, strict=True):
        rest[start:end] = True
    rest_before = np.concatenate([[0], np.cumsum(rest)])
    above = np.searchsorted(limits, part)
    before = np.concatenate([[0], above[:-1]])
    turns = np.flatnonzero(above != before)
    above, before = above[turns], before[turns]
    latencies_ms = np.full((len(track.slips), limits.size), np.nan)
    false, on_rest = np.zeros(limits.size, np.int64), np.zeros(limits.size, np.int64)
    starts = np.array([slip.start for slip in track.slips])
    for t in range(limits.size):
        rises = turns[(before <= t) & (above > t)]
        falls = turns[(before > t) & (above <= t)]
        ends = np.concatenate([falls, [len(part)] * (len(rises) - len(falls))]).astype(int)
        on_rest[t] = np.sum(rest_before[ends] - rest_before[rises])
        off_long_enough = rises[1:] - ends[:-1] >= rows.off_rows
        alarms = rises[np.concatenate([[True] * min(len(rises), 1), off_long_enough]).astype(bool)]
        alarms = alarms[alarms >= rows.settled[0]]
        slip = np.searchsorted(rows.highs, alarms, 'right')
        belongs = alarms >= np.append(rows.lows, len(part))[slip]
        false[t] = np.count_nonzero(~belongs)
        found, first = np.unique(slip[belongs], return_index=True)
        latencies_ms[found, t] = (alarms[belongs][first] - starts[found]) * (1e3 / rate_hz)
    latencies_ms[~rows.scored] = np.nan
    rest_s = rows.rest_rows / rate_hz
    return ThresholdSweep(
        latencies_ms, rows.scored, rows.leads_s, rows.windows_s, false, rest_s, on_rest / rate_hz
    )


def _level(config: ChainConfig, volts: Floats) -> Floats:
    """Return the level of a recording without gaps, an expression for each stage; shape (n, c)."""
    deviations = volts - volts[0]
    if config.common_mode != 'none':
        take = np.median if config.common_mode == 'median' else np.mean
        deviations = deviations - np.asarray(take(deviations, axis=1, keepdims=True))
    filtered = signal.sosfilt(design(config), deviations, axis=0)
    squares = (np.abs(filtered) ** config.exponent) ** 2
    envelope = np.sqrt(_windowed_mean(squares, config.samples(config.envelope_window_s)))
    return _windowed_mean(envelope, config.samples(config.decision_window_s))


def _windowed_mean(values: Floats, window: int) -> Floats:
    sums = np.cumsum(np.concatenate([np.zeros((window, values.shape[1])), values]), axis=0)
    # Rounding errors may make the difference of two sums negative.
    return np.asarray(np.maximum((sums[window:] - sums[:-window]) / window, 0.0))


def _statistics(level: Floats, config: ChainConfig, votes: Sequence[Vote]) -> dict[Vote, Floats]:
    """Return the largest statistic of all groups for each vote; shapes (n,)."""
    best = {vote: np.zeros(len(level)) for vote in votes}
    for members in config.groups.values():
        ordered = np.sort(level[:, np.array(members) - 1], axis=1)
        for vote, most in best.items():
            if vote == 'all':
                mine = ordered[:, 0]
            elif vote == 'mean':
                with np.errstate(divide='ignore'):
                    mine = np.exp(np.log(ordered).mean(axis=1))
            else:
                mine = ordered[:, -int(vote)]
            np.maximum(most, mine, out=most)
    return best


def measure_search(trials: int = TRIALS, minutes: float = MINUTES) -> dict[str, Any]:
    """Compare a search with the same search with :class:`NumpyProblem`.

    Parameters
    ----------
    trials
        Number of trials of each search.
    minutes
        Length of the recording.

    Raises
    ------
    RuntimeError
        When the two find different chains.
    """
    from optuna.distributions import CategoricalDistribution

    given = ChainConfig()
    track = slips_and_noise(minutes)
    space = SearchSpace(given)
    only: dict[str, Any] = {'decision': 'mean', 'mains_hz': 0.0}
    distributions = space.distributions | {
        name: CategoricalDistribution((value,)) for name, value in only.items()
    }
    points = [point | only for point in space.starts() if point['decision'] == 'mean']
    sides = [(kind([track]), Study(distributions, seed=0)) for kind in (Problem, NumpyProblem)]
    for problem, _ in sides:  # compile and load before the measurement
        problem.best(given)
    spent_s, same = [0.0, 0.0], 0
    with garbage_collection_off():
        for k in range(trials):
            costs_ms = []
            for i, (problem, study) in enumerate(sides):
                start_s = time.process_time()
                trial = study.ask(points[k] if k < len(points) else None)
                try:
                    found = problem.best(space.chain(trial.params))
                except ValueError:  # no such filter
                    found = []
                cost_ms = found[0].cost_ms if found else None
                study.tell(trial, cost_ms, {})
                spent_s[i] += time.process_time() - start_s
                costs_ms.append(cost_ms if cost_ms is not None else np.inf)
            same += costs_ms[0] == costs_ms[1] or abs(costs_ms[0] - costs_ms[1]) < SAME_COST_MS
    if same < LEAST_AGREEMENT * trials:
        raise RuntimeError(
            f'the search and its NumPy rival found the same in {same} of {trials} trials'
        )
    return {
        'trials': trials,
        'search_s': spent_s[0],
        'numpy_s': spent_s[1],
        'speedup': spent_s[1] / spent_s[0],
        'agreement': same / trials,
    }
