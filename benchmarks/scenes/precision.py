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

"""Errors and run times of the live stepper and of SciPy's integrators on one scene."""

import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes.build import build_scene
from benchmarks.scenes.front import FRONT_ERROR, front_ratio
from benchmarks.scenes.integrators import (
    EXPLICIT,
    BudgetSpentError,
    Solution,
    live_onset_s,
    showing_shears,
    solve,
)
from benchmarks.scenes.ode import Ode
from benchmarks.scenes.sizes import SceneSizes
from benchmarks.timing import garbage_collection_off
from slip_detector.parameters.files import read_yaml
from slip_detector.scenes.motion import LoadNumbers

Floats = NDArray[np.float64]

#: Time before and after the start of the motion that belongs to the stretch.
STRETCH_S = (0.02, 0.18)

#: Methods and relative tolerances; the first two that succeed are the reference and its check.
REFERENCES = (('BDF', 1e-10), ('LSODA', 1e-10), ('Radau', 1e-9))

#: Processor time that each of them is given.
REFERENCE_BUDGET_S = 120.0

#: Runs that take longer are not repeated.
FAST_S = 0.7


def scene_precision(path: Path, sizes: SceneSizes) -> dict[str, Any]:
    """Measure the errors and run times of all methods on one scene."""
    description = read_yaml(path)
    scene = build_scene(description)
    ode = Ode(scene)
    entry: dict[str, Any] = {
        'scene': path.stem, 'simulated_s': scene.duration_s, 'states': ode.size, 'note': '',
        'range_v': None, 'reference': None, 'runs': [], 'shipped_live': None, 'front': None,
    }  # fmt: skip
    if not ode.size:
        entry['note'] = 'no friction and no low-pass: its volts are a closed form of the time'
        return entry
    (method, rtol, reference), (check_method, _, check) = _references(ode)
    errors = Errors(reference, ode)
    entry['range_v'] = errors.range_v
    entry['reference'] = {
        'method': method,
        'check': check_method,
        'rtol': rtol,
        **errors.of(check.clean_v, check.position_m, check.onset_s),
    }
    for n in sizes.steps_per_sample:
        entry['runs'].append(_live(description, n, errors, ode, sizes))
    shipped = _live(description, scene.constants.steps_per_sample, errors, ode, sizes)
    entry['shipped_live'] = shipped
    for name in ('LSODA', 'BDF', 'Radau', *EXPLICIT):
        tolerances = sizes.explicit_tolerances if name in EXPLICIT else sizes.tolerances
        gave_up = name in EXPLICIT
        for rtol in tolerances:
            run = None if gave_up else _rival(ode, name, rtol, errors, sizes, None)
            if run is None or run['said']:
                gave_up = True
                run = _rival(ode, name, rtol, errors, sizes, _stretch(ode))
            entry['runs'].append(run)
    if entry['reference']['voltage_error'] < FRONT_ERROR:
        entry['front'] = front_ratio(entry['runs'])
    else:
        entry['note'] = 'the two references differ by more than the errors to be compared'
    return entry


def _references(ode: Ode) -> list[tuple[str, float, Solution]]:
    """Return the solutions of two methods with the tightest tolerances."""
    solutions: list[tuple[str, float, Solution]] = []
    for method, rtol in REFERENCES:
        try:
            solutions.append((method, rtol, solve(ode, method, rtol, budget_s=REFERENCE_BUDGET_S)))
        except RuntimeError:  # The next method may succeed.
            continue
        if len(solutions) == 2:
            return solutions
    raise RuntimeError('there is no reference: fewer than two methods could solve the scene')


def _stretch(ode: Ode) -> tuple[int, int]:
    """Return the first and last sample of the stretch about the start of the motion."""
    rate_hz = ode.scene.true_rate_hz
    start_s = ode.moving_s()
    if not math.isfinite(start_s):
        start_s = 0.5 * ode.scene.duration_s
    if ode.with_object:
        # Before the grip opens, the load on the object is the last to change.
        load = LoadNumbers(*ode.drive.load)
        pulled = np.flatnonzero(np.diff(load.force_n) != 0.0)
        start_s = float(load.corners_s[pulled[1]]) if len(pulled) > 1 else start_s
    first = max(round((start_s - STRETCH_S[0]) * rate_hz), 0)
    return first, min(round((start_s + STRETCH_S[1]) * rate_hz), ode.scene.length - 1)


class Errors:
    """Errors against a reference.

    Parameters
    ----------
    reference
        The solution that is taken as exact.
    ode
        The scene that was solved.
    """

    def __init__(self, reference: Solution, ode: Ode) -> None:
        self.reference, self.ode = reference, ode
        self.range_v = float(np.ptp(reference.clean_v))

    def of(
        self, clean_v: Floats, position_m: Floats, onset_s: Floats, first: int = 0
    ) -> dict[str, float | None]:
        """Return the errors of a solution that begins with the sample ``first``."""
        reference = self.reference
        n = min(len(clean_v), len(reference.clean_v) - first)
        rows = slice(first, first + n)
        voltage = float(np.abs(clean_v[:n] - reference.clean_v[rows]).max()) / self.range_v
        onset_error_s = np.abs(onset_s - reference.onset_s)
        # An onset that only one of the two has gives no error: a stretch need not have them all.
        some = np.isfinite(onset_error_s)
        onset = float(onset_error_s[some].max()) if some.any() else None
        way = position = relative = None
        if self.ode.with_object:
            way = float(np.ptp(reference.position_m))
            position = float(np.abs(position_m[:n] - reference.position_m[rows]).max())
            relative = position / way if way else None
        return {
            'voltage_error': voltage,
            'onset_error_s': onset,
            'position_error_m': position,
            'position_error': relative,
        }


def _live(
    description: Mapping[str, Any],
    steps_per_sample: int,
    errors: Errors,
    ode: Ode,
    sizes: SceneSizes,
) -> dict[str, Any]:
    """Run the live stepper."""
    rate_hz = ode.scene.true_rate_hz
    step_s = (1.0 + 1e-6) / (rate_hz * steps_per_sample)
    n = len(errors.reference.time_s)
    least_s = math.inf
    for _ in range(sizes.rounds + 1):
        scene = build_scene(description, step_s=step_s)
        with garbage_collection_off():
            start_s = time.thread_time()
            _, clean_v, position_m, _ = scene.clean(n)
            least_s = min(least_s, time.thread_time() - start_s)
    sheared = build_scene(showing_shears(description, scene))
    onset_s = live_onset_s(sheared, ode)
    return {
        'method': 'live',
        'setting': f'{scene.constants.steps_per_sample} steps a sample',
        'over': [0.0, float(errors.reference.time_s[-1])],
        **errors.of(clean_v, position_m, onset_s),
        'run_time_per_s': least_s * rate_hz / n,
        'steps': scene.constants.steps_per_sample * (n - 1),
        'said': '',
    }


def _rival(
    ode: Ode,
    method: str,
    rtol: float,
    errors: Errors,
    sizes: SceneSizes,
    stretch: tuple[int, int] | None,
) -> dict[str, Any]:
    """Run one of SciPy's methods; ``said`` is the message with which it refuses or gives up."""
    reference = errors.reference
    first, last = stretch or (0, len(reference.time_s) - 1)
    start = reference.states[first] if stretch else None
    time_s = reference.time_s
    run: dict[str, Any] = {
        'method': method, 'setting': f'rtol {rtol:g}',
        'over': [float(time_s[first]), float(time_s[last])], 'voltage_error': None,
        'onset_error_s': None, 'position_error_m': None, 'position_error': None,
        'run_time_per_s': None, 'steps': None, 'said': '',
    }  # fmt: skip
    least_s = math.inf
    try:
        for _ in range(sizes.rounds):
            with garbage_collection_off():
                budget_s = sizes.stretch_budget_s if stretch else sizes.budget_s
                solution = solve(ode, method, rtol, stretch, start, budget_s)
            least_s = min(least_s, solution.run_time_s)
            if solution.run_time_s > FAST_S:
                break
    except (BudgetSpentError, ValueError, RuntimeError) as error:
        return run | {'said': str(error)}
    simulated_s = solution.time_s[-1] - solution.time_s[0]
    return (
        run
        | errors.of(solution.clean_v, solution.position_m, solution.onset_s, first)
        | {'run_time_per_s': least_s / simulated_s, 'steps': solution.steps}
    )
