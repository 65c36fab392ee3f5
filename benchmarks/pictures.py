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
from typing import Any

from matplotlib import pyplot as plt

from slip_detector.report.pictures import COLORS, save_picture

#: Markers for the sample rates, or for the methods.
MARKERS = ('o', 's', '^', 'D', 'v', 'P')


def draw_scenes_precision(path: Path, figures: Mapping[str, Any]) -> None:
    """Draw voltage error against run time of each scene, for the live stepper and its rivals.

    Parameters
    ----------
    path
        The picture to write.
    figures
        The figures of :func:`benchmarks.scenes.measure.measure_scenes`.
    """
    entries = [entry for entry in figures['precision'] if entry['runs']]
    columns = min(3, max(len(entries), 1))
    rows = max(math.ceil(len(entries) / columns), 1)
    figure, axes = plt.subplots(
        rows, columns, figsize=(4.2 * columns, 3.2 * rows + 0.6), sharex=True, sharey=True,
        squeeze=False, layout='constrained',
    )  # fmt: skip
    # Black is for the live stepper, with which the others are compared.
    styles = list(zip(('k', *COLORS), MARKERS, strict=False))
    for axis, entry in zip(axes.flat, entries, strict=False):
        floor = entry['reference']['voltage_error']
        axis.axvspan(1e-12, floor, color='0.9', zorder=0)
        axis.axhline(1e3, color='0.6', linestyle='--', linewidth=1)
        for name, (color, marker) in zip(('live', 'LSODA', 'BDF'), styles, strict=False):
            runs = [run for run in entry['runs'] if run['method'] == name and not run['said']]
            errors = [max(run['voltage_error'], floor) for run in runs]
            times_ms = [run['run_time_per_s'] * 1e3 for run in runs]
            axis.plot(errors, times_ms, color=color, marker=marker, markersize=5, label=name)
        axis.set(xscale='log', yscale='log', xlim=(1e-9, 1.0))
        axis.set_title(entry['scene'], fontsize=10)
        axis.grid(color='0.93', linewidth=0.5)
    for axis in axes.flat[len(entries) :]:
        axis.set_axis_off()
    figure.supxlabel("worst voltage error / range of the volts (grey: below the reference's own)")
    figure.supylabel('run time for a simulated second [ms] (dashed: real time)')
    handles, labels = axes.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc='outside upper center', ncols=len(labels), frameon=False)
    save_picture(figure, path)
