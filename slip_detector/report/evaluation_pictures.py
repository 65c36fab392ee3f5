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

"""A picture of an evaluation: the latencies, their parts by stage, and the ROC curve."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from slip_detector.evaluation.figures import STAGES, ReplayOutcome, figures_of_merit
from slip_detector.evaluation.scores import MOTION, ScoreCounts
from slip_detector.report.pictures import save_picture


def draw_evaluation(path: Path, outcomes: Sequence[ReplayOutcome]) -> None:
    """Draw the latencies of all detected slips, their mean parts and the ROC curve.

    Parameters
    ----------
    path
        The picture to write.
    outcomes
        The outcome of each recording, at least one.

    Examples
    --------
    >>> import tempfile
    >>> from slip_detector import ChainConfig
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.evaluation.replay import Replay
    >>> rows = Samples.evenly(np.full((380, 16), 4.3), 380.0, np.arange(380) >= 190)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'evaluation.png'
    ...     draw_evaluation(path, [Replay(ChainConfig()).run([rows])])
    ...     path.is_file()
    True
    """
    figure, (latencies, parts, roc) = plt.subplots(
        ncols=3, figsize=(13, 4.2), layout='constrained', width_ratios=(1.2, 1, 1)
    )
    _draw_latencies(latencies, outcomes)
    _draw_parts(parts, outcomes)
    _draw_roc(roc, outcomes)
    for axis in (latencies, parts, roc):
        axis.grid(color='0.9', linewidth=0.5)
        axis.set_axisbelow(True)
    save_picture(figure, path)


def _draw_latencies(axis: Axes, outcomes: Sequence[ReplayOutcome]) -> None:
    slips = [slip for one in outcomes for slip in one.slips if not slip.settling]
    known_ms = [slip.latency_s * 1e3 for slip in slips if slip.latency_s is not None]
    missed = len(slips) - len(known_ms)
    if known_ms:
        axis.hist(known_ms, bins=min(40, max(10, len(known_ms) // 5)), color='C0')
        axis.yaxis.set_major_locator(MaxNLocator(integer=True))  # slips are whole numbers
        median, p90 = np.percentile(known_ms, [50, 90])
        axis.axvline(median, color='k', linewidth=1, label=f'median {median:.0f} ms')
        axis.axvline(p90, color='k', linewidth=1, linestyle=':', label=f'p90 {p90:.0f} ms')
        axis.legend(loc='upper right')
    axis.set(xlabel='latency of the global signal [ms]', ylabel='slips')
    axis.set_title(f'{len(known_ms)} detected, {missed} missed', fontsize=10)


def _draw_parts(axis: Axes, outcomes: Sequence[ReplayOutcome]) -> None:
    values = figures_of_merit(outcomes)
    for row, lead in enumerate(('', 'late_')):
        end_ms = 0.0
        for k, stage in enumerate(STAGES):
            part_ms = values[f'{lead}{stage}_ms']
            if part_ms is not None:
                label = stage if not row else None
                axis.barh(row, part_ms, 0.6, left=end_ms, color=f'C{k}', label=label)
                end_ms += part_ms
        if not end_ms:
            axis.text(0.0, row, '  none', va='center')
    axis.set_yticks([0, 1], ['detected', 'of them\nlate'])
    axis.set(xlabel='mean latency [ms]', ylim=(1.6, -0.9), xlim=(0.0, None))
    if axis.get_legend_handles_labels()[0]:
        axis.legend(loc='upper center', ncols=4, frameon=False, fontsize=8, handlelength=1.0)
    axis.set_title('where the time went', fontsize=10)


def _draw_roc(axis: Axes, outcomes: Sequence[ReplayOutcome]) -> None:
    scores = ScoreCounts.pooled([one.scores for one in outcomes if one.scores is not None])
    moving = any(one.moving_rows is not None for one in outcomes)
    kinds: list[tuple[str, tuple[int, ...] | None]] = [('all other rows', None)]
    if moving:
        kinds.append(('rows of motion', (MOTION,)))
    for name, against in kinds:
        area = scores.auc() if against is None else scores.auc(against)
        if area is None:
            continue
        false_share, true_share, limit = scores.roc() if against is None else scores.roc(against)
        (line,) = axis.plot(
            [0.0, *false_share], [0.0, *true_share], label=f'{name}: {area:.3f}', linewidth=1.2
        )
        at = max(int(np.searchsorted(-limit, -1.0, 'right')) - 1, 0)
        axis.plot(false_share[at], true_share[at], 'o', color=line.get_color())
    axis.plot([0.0, 1.0], [0.0, 1.0], color='0.7', linewidth=0.8, linestyle=':')
    axis.set(xlabel='share of the rows without slip', ylabel='share of the rows with slip')
    axis.set_title('ROC of the decision statistic (dot: threshold)', fontsize=10)
    if axis.get_legend_handles_labels()[0]:
        axis.legend(title='area, slip against', loc='lower right', frameon=False)
