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

"""The simulated fingertip in extreme cases: whether it stays finite and exact, or is refused.

Each case is a short scene, run by the live stepper with its shipped step unless the case says
otherwise. The reference is LSODA at a relative tolerance of 1e-9 (SciPy's, see
:mod:`benchmarks.scenes.integrators`), checked by BDF at 1e-8. When neither can solve a scene, its
reference is the live stepper with steps 16 times as short, and the row says so.

:func:`measure_extremes` gives one object (keys of ``python -m benchmarks extremes --json``):

``extremes``
    One object for each case: ``case``, ``setting``, ``method``; ``said``: the message with which
    it is refused before it starts (the rest is then null), else empty; ``finite``: whether all
    results are; ``shear_share``: the largest shear of a taxel as a share of the static friction
    under its largest load; ``volts_share``: the largest voltage as a share of what loads, ridges
    and friction allow; ``bounded``: whether both are at most 1 (2 for skin with mass, which may
    overshoot); ``energy_created``: the most by which the energy stored in the friction has
    exceeded the work done on it, as a share of all work (the work of a step and the energy that it
    stores differ by up to 0.05 sigma0 (h w)^2, the quadrature error of a method of second order,
    which does not accumulate); ``voltage_error``: the worst, as a share of the range of the
    reference's volts; ``position_error_m`` of an object until it is lost; ``reference``: its
    method; ``reference_error``: how far its check differs from it.
``hour``
    One hour of sliding forth and back, with rests (one minute with ``--quick``): ``simulated_s``,
    ``cycles``; ``drift``: the largest difference of the volts of the last cycle from those of the
    second, as a share of their range; ``work_growth``: the relative difference of the work of
    these cycles; ``finite`` and ``energy_created`` as above.
``wanted``
    For each claim its measured ``value``, the ``bound`` as text and whether it is ``met``.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.extremes.cases import CYCLE_S, Case, cases, description_of, sliding_cycles
from benchmarks.scenes.build import build_scene
from benchmarks.scenes.integrators import (
    BudgetSpentError,
    Solution,
    refuse_impossible,
    showing_shears,
    solve,
)
from benchmarks.scenes.ode import Ode
from benchmarks.verdicts import verdicts
from slip_detector.evaluation.figures import Bound
from slip_detector.scenes import Scene
from slip_detector.scenes.friction import LIGHTEST_LOAD_N
from slip_detector.scenes.mechanics import LEAST, WORK

Floats = NDArray[np.float64]

WANTED = {
    'extremes.not_finite_or_bounded': Bound(high=0.0),
    'extremes.energy_created': Bound(high=1e-9),
    'extremes.voltage_error': Bound(high=1e-2),
    'hour.drift': Bound(high=1e-6),
    'hour.work_growth': Bound(high=1e-6),
    'hour.energy_created': Bound(high=1e-9),
}

ALL = 10**9

#: Methods and relative tolerances of the references, and the processor time that each is given.
REFERENCES = (('LSODA', 1e-9), ('BDF', 1e-8))
REFERENCE_S = 12.0

#: If no other method can be the reference, it is the live stepper with this many times the steps.
FINER = 16

HOUR_S, MINUTE_S = 3600.0, 60.0
HOUR_RATE_HZ = 125.0


def measure_extremes(quick: bool = False) -> dict[str, Any]:
    """Run all cases; the keys are in the module's docstring.

    Parameters
    ----------
    quick
        Leave out the cases with slow references, and slide for a minute instead of an hour.
    """
    rows = [measure_case(case) for case in cases() if case.of_quick or not quick]
    hour = measure_long_run(MINUTE_S if quick else HOUR_S)
    done = [row for row in rows if not row['said']]
    values: dict[str, float] = {
        'extremes.not_finite_or_bounded': float(
            sum(not (row['finite'] and row['bounded']) for row in done)
        ),
        'extremes.energy_created': max(row['energy_created'] for row in done),
        'extremes.voltage_error': max(row['voltage_error'] for row in done),
    } | {f'hour.{name}': hour[name] for name in ('drift', 'work_growth', 'energy_created')}
    return {'extremes': rows, 'hour': hour, 'wanted': verdicts(WANTED, values)}


def measure_case(case: Case, with_reference: bool = True) -> dict[str, Any]:
    """Run one scene.

    Parameters
    ----------
    case
        One of :func:`benchmarks.extremes.cases.cases`.
    with_reference
        Whether to compare the case with a reference; without one the errors are None.

    Returns
    -------
    dict
        One object of ``extremes``.

    Raises
    ------
    RuntimeError
        When a method that has to refuse the scene does not.
    """
    row: dict[str, Any] = {
        'case': case.case, 'setting': case.setting, 'method': case.method, 'said': '',
        'finite': None, 'bounded': None, 'shear_share': None, 'volts_share': None,
        'energy_created': None, 'voltage_error': None, 'position_error_m': None,
        'reference': None, 'reference_error': None,
    }  # fmt: skip
    description = description_of(case)
    try:
        scene = build_scene(description)
        if case.method != 'live':
            refuse_impossible(Ode(scene), case.method, (0.0, scene.duration_s))
            raise RuntimeError(f'{case.method} did not refuse {case.case}, {case.setting}')
    except ValueError as error:
        return row | {'said': str(error)}
    ledger = np.zeros(3)
    _, clean_v, position_m, sliding = scene.clean(ALL, ledger)
    sheared = build_scene(showing_shears(description, scene))
    _, shear_n, _, _ = sheared.clean(ALL)
    finite = all(np.isfinite(a).all() for a in (clean_v, position_m, sliding, shear_n, ledger))
    shear_share, volts_share = _shares(scene, clean_v, shear_n)
    most = 2.0 if scene.constants.skin.mass_kg > 0.0 else 1.0 + 1e-6
    row |= {
        'finite': bool(finite),
        'bounded': bool(max(shear_share, volts_share) <= most),
        'shear_share': shear_share,
        'volts_share': volts_share,
        'energy_created': _created(ledger),
    }
    if not with_reference:
        return row
    solution, row['reference'], row['reference_error'] = _reference(description)
    n = min(len(clean_v), len(solution.clean_v))
    difference_v = np.abs(clean_v[:n] - solution.clean_v[:n]).max()
    row['voltage_error'] = float(difference_v / np.ptp(solution.clean_v))
    if 'object' in scene.parts:
        far_m = np.abs(position_m[:n] - solution.position_m[:n])
        row['position_error_m'] = float(far_m.max())
    return row


def _reference(description: Mapping[str, Any]) -> tuple[Solution, str, float | None]:
    """Return a reference, its name, and how far its check differs from it."""
    solutions: list[tuple[Solution, str]] = []
    try:
        ode = Ode(build_scene(description))
        for method, rtol in REFERENCES:
            try:
                solutions.append((solve(ode, method, rtol, budget_s=REFERENCE_S), method))
            except (BudgetSpentError, RuntimeError):  # The other method may succeed.
                continue
    except ValueError:  # The scene is not a differential equation.
        pass
    if not solutions:
        scene = build_scene(description)
        times_s, clean_v, position_m, _ = build_scene(
            description, step_s=scene.constants.step_s / FINER
        ).clean(ALL)
        nothing = np.zeros(0)
        finer = Solution(
            times_s, clean_v, position_m, nothing, math.inf, nothing, 0.0, len(times_s), 0
        )
        return finer, f'live, steps / {FINER}', None
    solution, name = solutions[0]
    if len(solutions) == 1:
        return solution, name, None
    other = solutions[1][0].clean_v
    n = min(len(other), len(solution.clean_v))
    gap_v = np.abs(other[:n] - solution.clean_v[:n]).max()
    return solution, name, float(gap_v / np.ptp(solution.clean_v))


def _created(ledger: Floats) -> float:
    """Return the energy that friction has created, as a share of the work done on it."""
    return max(0.0, -float(ledger[LEAST])) / max(float(ledger[WORK]), 1e-300)


def _shares(scene: Scene, clean_v: Floats, shear_n: Floats) -> tuple[float, float]:
    """Return the largest shear and voltage as shares of what contact and friction allow."""
    constants = scene.constants
    times_s = np.linspace(0.0, scene.duration_s, 4001)
    force_n = float(scene.force_n(times_s).max())
    load_n = scene.contact.largest_load_n(1.001 * force_n) + LIGHTEST_LOAD_N
    coefficient = (
        constants.friction.static if constants.friction.static else constants.friction.kinetic
    )
    friction_n = max(coefficient, constants.friction.kinetic) * load_n
    ridges = float(np.abs(constants.ridges.amplitudes).sum())
    most_v = np.abs(constants.normal_v_n) * load_n * (1.0 + ridges)
    most_v = most_v + np.abs(constants.shear_v_n) * friction_n
    return (
        float(np.abs(shear_n).max()) / friction_n,
        float((np.abs(clean_v).max(axis=0) / most_v).max()),
    )


def measure_long_run(simulated_s: float) -> dict[str, Any]:
    """Slide forth and back for a long time, and compare the last cycle with the second."""
    cycles = round(simulated_s / CYCLE_S) - 1
    scene = build_scene(
        {
            'steps': sliding_cycles(cycles),
            'friction': {},
            'texture': {},
            'sample_rate_hz': HOUR_RATE_HZ,
        }
    )
    per_cycle = round(CYCLE_S * HOUR_RATE_HZ)
    ledger = np.zeros(3)
    finite = True
    volts, works = [], []
    for _ in range(scene.length // per_cycle):
        before = ledger[WORK]
        _, clean_v, _, _ = scene.clean(per_cycle, ledger)
        finite &= bool(np.isfinite(clean_v).all() and np.isfinite(ledger).all())
        volts.append(clean_v)
        works.append(float(ledger[WORK] - before))
    second_v, last_v = volts[2], volts[-1]
    return {
        'simulated_s': scene.duration_s,
        'cycles': cycles,
        'finite': finite,
        'drift': float(np.abs(last_v - second_v).max() / np.ptp(second_v)),
        'work_growth': abs(works[-1] - works[2]) / works[2],
        'energy_created': _created(ledger),
    }
