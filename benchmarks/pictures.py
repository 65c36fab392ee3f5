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
"""Pictures of error against run time."""

import math
from collections.abc import Mapping
from pathlib import Path

from matplotlib.figure import Figure

from slip_detector.report.pictures import COLORS, save_picture

#: Runs by method: the error and the run time of each.
Runs = Mapping[str, list[tuple[float, float]]]


def draw_work_precision(
    path: Path, panels: Mapping[str, Runs], error_label: str, time_label: str
) -> None:
    """Draw the run time of each method over its error, in a panel for each problem."""
    columns = min(3, len(panels))
    rows = math.ceil(len(panels) / columns)
    figure = Figure(figsize=(4.4 * columns, 3.2 * rows + 0.8), layout='constrained')
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axis in axes.flat[len(panels) :]:
        axis.set_axis_off()
    for axis, (title, runs) in zip(axes.flat, panels.items(), strict=False):
        for (name, points), color in zip(runs.items(), ('k', *COLORS), strict=False):
            axis.plot(*zip(*sorted(points), strict=True), 'o-', ms=5, color=color, label=name)
        axis.set(xscale='log', yscale='log')
        axis.set_title(title, fontsize=10)
        axis.grid(color='0.93', linewidth=0.5)
    handles, names = axes.flat[0].get_legend_handles_labels()
    figure.legend(handles, names, loc='outside upper center', ncols=len(names), frameon=False)
    figure.supxlabel(error_label)
    figure.supylabel(time_label)
    save_picture(figure, path)
