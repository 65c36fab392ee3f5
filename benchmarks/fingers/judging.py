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

"""The figures of a chain on recordings of a finger, each of which is one continuous stream."""

from collections.abc import Sequence

import numpy as np

from benchmarks.fingers.joints import joint_latencies_s
from slip_detector.chain.samples import Bools, Floats
from slip_detector.evaluation.figures import ReplayOutcome, figures_of_merit, percent
from slip_detector.evaluation.replay import Replay
from slip_detector.evaluation.scores import REST, SLIP, WITHOUT_SLIP, ScoreTally
from slip_detector.parameters import ChainConfig, EvaluationConfig
from slip_detector.tuning.tracks import Track

#: Length of the cross-fade of a joint without mains.
FADE_S = 0.08

#: The figures of the evaluation that are given.
OF_SLIPS = 'slips', 'recall', 'recall_by_chance', 'coverage', 'false_alarms_per_minute'

#: The outcome of a recording; and what was found in it by its name: the decision statistic of
#: scored rows that ``slide``, of those ``between`` slips (or of a recording without a kind), and
#: of those of :data:`.WITHOUT_SLIP`; and the latencies at joints with a slide and with a rest.
Judged = tuple[ReplayOutcome, dict[str, Floats]]


def judge(
    chain: ChainConfig, track: Track, config: EvaluationConfig, mains_rows: int = 0
) -> Judged:
    """Run a chain over a recording and its joints, cross-faded over whole periods of the mains."""
    outcome = Replay(chain, config).run(track.rows(), track.sample_rate_hz)
    names = 'rest' if track.kind else 'between', *WITHOUT_SLIP[1:], 'slide'
    scores, counts = outcome.scores.scores, outcome.scores.counts
    found = {name: np.repeat(scores, its) for name, its in zip(names, counts, strict=True)}
    for name in ('slide', 'rest'):
        how = chain, track, name == 'slide', mains_rows or chain.samples(FADE_S)
        found[f'{name} joints'] = joint_latencies_s(*how) if track.slips else np.zeros(0)
    return outcome, found


def pooled(several: Sequence[Judged], *names: str) -> Floats:
    """Return what was found of one thing, or of more, in all recordings."""
    every = (found[name] for _, found in several for name in names if name in found)
    return np.concatenate([np.zeros(0), *every])


def area(positive: Floats, negative: Floats) -> float | None:
    """Return the area under the ROC curve of some rows against others; None without either.

    Examples
    --------
    >>> area(np.full(9, 2.0), np.full(5, 2.0)), area(np.full(9, 2.0), np.zeros(5))
    (0.5, 1.0)
    """
    tally = ScoreTally()
    for rows, kind in ((positive, SLIP), (negative, REST)):
        tally.add(rows, np.full(rows.size, kind))
    return tally.collect().auc()


def figures(several: Sequence[Judged]) -> dict[str, float | None]:
    """Return the figures of recordings; see :mod:`benchmarks.fingers.command`."""
    of = figures_of_merit([outcome for outcome, _ in several])
    found = {name: of[name] for name in OF_SLIPS}
    slide, rest = pooled(several, 'slide'), pooled(several, 'between', 'rest')
    names = 'between', *WITHOUT_SLIP
    kinds = {name: its for name in names if (its := pooled(several, name)).size}
    every = np.concatenate([slide, *kinds.values()])
    for name, its in {'slide': slide, **kinds, 'all': every}.items():
        found[f'{name}_on_percent'] = _percent(its >= 1.0)
    for name, its in kinds.items():
        found |= {f'{name}_auc': area(slide, its), f'{name}_auc_of_rest': area(rest, its)}
    for name in ('slide', 'rest'):
        late_s = pooled(several, f'{name} joints')
        median_ms = 1e3 * float(np.median([*late_s] or [np.inf]))
        found[f'joints_of_{name}'] = late_s.size
        found[f'joints_of_{name}_detected_percent'] = _percent(late_s < np.inf)
        found[f'joints_of_{name}_ms'] = median_ms if median_ms < np.inf else None
    return found


def _percent(which: Bools) -> float | None:
    return percent(float(which.sum()), which.size)
