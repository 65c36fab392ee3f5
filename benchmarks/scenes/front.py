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

"""Comparison of the live stepper with the fastest other method at the same error."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: The live stepper is wanted to be the fastest at this error and above.
FRONT_ERROR = 1e-3

#: Stands for an error of 0, which has no logarithm.
LEAST_ERROR = 1e-16


def front_ratio(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Compare the live stepper with all other methods at errors of ``FRONT_ERROR`` and above.

    A method's time for an error is that of its fastest run with no larger error; between two runs
    it is interpolated linearly in the logarithms. The methods are compared at ``FRONT_ERROR`` and
    at the error of each run of the other method that is larger.
    """
    live = _envelope([run for run in runs if run['method'] == 'live'])
    worst: dict[str, Any] = {'ratio': None, 'against': ''}
    for method in dict.fromkeys(run['method'] for run in runs if run['method'] != 'live'):
        rival = _envelope([run for run in runs if run['method'] == method and not run['said']])
        if not len(rival):
            continue
        at = sorted({FRONT_ERROR, *(e for e in rival[:, 0] if e > FRONT_ERROR)})
        for error in at:
            theirs, ours = _time_at(error, rival), _time_at(error, live)
            if theirs is None:
                continue
            ratio = math.inf if ours is None else ours / theirs
            if worst['ratio'] is None or ratio > worst['ratio']:
                worst = {'ratio': ratio, 'against': f'{method} at {error:.1e}'}
    return worst


def _envelope(runs: list[dict[str, Any]]) -> Floats:
    """Return errors (falling) and run times (rising) of the runs that no other beats in both."""
    points = sorted(
        (run['run_time_per_s'], run['voltage_error']) for run in runs if not run['said']
    )
    kept: list[tuple[float, float]] = []
    for run_time, error in points:
        if not kept or error < kept[-1][0]:
            kept.append((max(error, LEAST_ERROR), run_time))
    return np.array(kept).reshape(-1, 2)


def _time_at(error: float, envelope: Floats) -> float | None:
    """Return the run time for an error; None when no run has so small an error."""
    errors, times = envelope[::-1].T  # errors rise
    if error < errors[0]:
        return None
    return float(np.exp(np.interp(np.log(error), np.log(errors), np.log(times))))
