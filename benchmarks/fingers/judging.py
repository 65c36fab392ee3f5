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

"""The figures of a chain on recordings of a finger.

Each recording is one continuous stream. Slips and alarms are matched, and rows are scored or left
out, as the evaluation does.
"""

from collections.abc import Sequence

import numpy as np

from benchmarks.fingers.joints import joint_latencies_s
from slip_detector.chain.filters import settling_rows
from slip_detector.chain.samples import Bools, Floats, Ints
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.figures import ReplayOutcome, figures_of_merit, percent
from slip_detector.evaluation.matching import ScoredRows
from slip_detector.evaluation.replay import Replay
from slip_detector.evaluation.scores import REST, SLIP, ScoreTally
from slip_detector.parameters import ChainConfig, EvaluationConfig
from slip_detector.recordings.labels import KINDS
from slip_detector.tuning.tracks import Track

#: What rows are that do not slide: those of a kind of recordings; and in those without a kind, as
#: those with slips, where the robot moves and the others.
NOTHING_SLIDES = ('between', 'motion', *KINDS)

#: Length of the cross-fade of a joint without mains.
FADE_S = 0.08

#: The figures of the evaluation that are given.
OF_SLIPS = 'slips', 'recall', 'recall_by_chance', 'coverage', 'false_alarms_per_minute'


#: The outcome of a recording; and the decision statistic of its scored rows by what they are:
#: ``slide`` or one of :data:`NOTHING_SLIDES`. With these are the latencies at joints with a slide
#: and with a rest, ``slide joints`` and ``rest joints``; see :func:`.joint_latencies_s`.
Judged = tuple[ReplayOutcome, dict[str, Floats]]


def judge(
    chain: ChainConfig, track: Track, config: EvaluationConfig, mains_rows: int = 0
) -> Judged:
    """Run a chain over a recording and its joints, cross-faded over whole periods of the mains."""
    rate_hz, fade_rows = track.sample_rate_hz, mains_rows or chain.samples(FADE_S)
    outcome = Replay(chain, config).run(track.rows(), rate_hz)
    runner, parts = SlipChain(chain), []
    for piece in track.rows():
        runner.restart()
        parts.append(runner.update(piece.volts, votes=[chain.vote]).vote_statistic[:, 0])
    statistic = np.concatenate(parts)
    stretches, accuracy_s = [one.interval for one in track.stretches], track.samples.accuracy_s
    settling = settling_rows(chain)
    scored = ScoredRows(track.slips, stretches, settling, config, rate_hz, accuracy_s)
    numbers = np.concatenate([np.arange(*one) for one in stretches])

    def within(starts: Ints, ends: Ints) -> Bools:
        edges = np.stack([starts, ends], axis=1).ravel()
        return np.asarray(np.searchsorted(edges, numbers, 'right') % 2 == 1)

    slide = within(scored.certain_starts, scored.certain_ends)
    rest = within(scored.rest_starts, scored.rest_ends)
    moving = rest & (False if track.samples.moving is None else track.samples.moving)
    which = {'slide': slide, track.kind or 'between': rest & ~moving, 'motion': moving}
    found = {name: statistic[its] for name, its in which.items()}
    for name, its in {'slide': slide, 'rest': rest}.items() if track.slips else ():
        found[f'{name} joints'] = joint_latencies_s(chain, track, rest, its, fade_rows)
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
    kinds = {name: its for name in NOTHING_SLIDES if (its := pooled(several, name)).size}
    every = np.concatenate([slide, *kinds.values()])
    for name, its in {'slide': slide, **kinds, 'all': every}.items():
        found[f'{name}_on_percent'] = _percent(its > 1.0)
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
