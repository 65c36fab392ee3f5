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

Each case is a short scene, run by the live stepper with its shipped step. The reference is LSODA
at a relative tolerance of 1e-9 (SciPy's, see :mod:`benchmarks.scenes.reference`), checked by BDF
at 1e-8. When neither can solve a scene, its reference is the live stepper with steps 16 times as
short, and the row says so.

Keys of ``python -m benchmarks extremes --json``:

``extremes``
    One object for each case: ``case``, ``setting``; ``said``: the message with which it is refused
    before it starts (the rest is then missing), else empty; ``volts_share``: the largest voltage
    as a share of what loads, ridges and friction allow; ``bounded``: whether it is finite and at
    most 1; ``voltage_error``: the worst, as a share of the range of the reference's volts;
    ``position_error_m`` of an object until it is lost; ``reference``: its method;
    ``reference_error``: how far its check differs from it.
``hour``
    One hour of sliding forth and back, with rests (one minute with ``--quick``): ``simulated_s``,
    ``cycles``; ``drift``: the largest difference of the volts of the last cycle from
    those of the second, as a share of their range.
``clocks``
    Streams of 8000 stamps with a clock that is off (its rate over the configured one, from the
    start or from one row on), independent jitter and lost samples: how many rows too many (or, if
    negative, too few) the detector would have of each, ``rows_off_mean`` of the absolute values
    and ``rows_off_most``.
``worst``
    Of all cases that are not refused: how many are ``not_finite_or_bounded``, and the largest
    ``voltage_error``.
"""

import argparse
from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.extremes.cases import CASES, CYCLE_S, description_of, sliding_cycles
from benchmarks.extremes.clocks import measure_clocks
from benchmarks.measurement import Bound, shared_options
from benchmarks.scenes.reference import Ode, Solution, build_scene, solve_live
from slip_detector.scenes import Scene
from slip_detector.scenes.friction import LIGHTEST_LOAD_N

WANTED = {
    'worst.not_finite_or_bounded': Bound(high=0.0),
    'worst.voltage_error': Bound(high=1e-2),
    'hour.drift': Bound(high=1e-6),
}

ALL = 10**9

#: Methods and relative tolerances of the references, and the processor time that each is given.
REFERENCES = (('LSODA', 1e-9), ('BDF', 1e-8))
REFERENCE_S, QUICK_REFERENCE_S = 12.0, 1.0

#: If no other method can be the reference, it is the live stepper with this many times the steps.
FINER = 16

HOUR_S, MINUTE_S = 3600.0, 60.0
HOUR_RATE_HZ = 125.0

#: Streams of stamps for each clock, jitter and share of losses.
STREAMS, QUICK_STREAMS = 200, 10


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    return shared_options(
        'extremes',
        'Run the simulated fingertip in extreme cases: whether all results are finite and '
        'bounded, the error against a tight reference, and what is refused with which message. '
        '--quick slides for a minute instead of an hour.',
    )


def measure(words: argparse.Namespace) -> dict[str, Any]:
    """Run all cases."""
    # With --quick the references have a second each.
    budget_s = QUICK_REFERENCE_S if words.quick else REFERENCE_S
    rows = [
        {'case': case, 'setting': setting, **_measure_case(description_of(more), budget_s)}
        for case, setting, more in CASES
    ]
    done = [row for row in rows if not row['said']]
    worst = {
        'not_finite_or_bounded': sum(not row['bounded'] for row in done),
        'voltage_error': max(row['voltage_error'] for row in done),
    }
    hour = _measure_long_run(MINUTE_S if words.quick else HOUR_S)
    clocks = measure_clocks(QUICK_STREAMS if words.quick else STREAMS)
    return {'extremes': rows, 'clocks': clocks, 'worst': worst, 'hour': hour}


def _measure_case(description: Mapping[str, Any], budget_s: float) -> dict[str, Any]:
    """Return one object of ``extremes``."""
    try:
        scene = build_scene(description)
    except ValueError as error:
        return {'said': str(error)}
    found = solve_live(scene, ALL)
    share = _volts_share(scene, found)
    reference, name, reference_error = _reference(description, budget_s)
    return {
        'said': '',
        'volts_share': share,
        # False, too, where anything is not finite.
        'bounded': share <= 1.0 + 1e-6,
        'voltage_error': reference.error(found),
        'position_error_m': reference.error_m(found) if 'object' in scene.parts else None,
        'reference': name,
        'reference_error': reference_error,
    }


def _reference(
    description: Mapping[str, Any], budget_s: float
) -> tuple[Solution, str, float | None]:
    """Return a reference, its name, and how far its check differs from it."""
    scene = build_scene(description)
    solutions: list[tuple[Solution, str]] = []
    for method, rtol in REFERENCES:
        try:
            solutions.append((Ode(scene).solve(method, rtol, budget_s), method))
        except (ValueError, RuntimeError):  # Another method may succeed.
            continue
    if not solutions:
        finer = build_scene(description, step_s=scene.constants.step_s / FINER)
        return solve_live(finer, ALL), f'live, steps / {FINER}', None
    solution, name = solutions[0]
    return solution, name, solution.error(solutions[1][0]) if len(solutions) == 2 else None


def _volts_share(scene: Scene, found: Solution) -> float:
    """Return the largest voltage as a share of what contact, ridges and friction allow."""
    constants, law = scene.constants, scene.constants.friction
    force_n = float(scene.force_n(np.linspace(0.0, scene.duration_s, 4001)).max())
    load_n = scene.parts['contact'].largest_load_n(1.001 * force_n) + LIGHTEST_LOAD_N
    friction_n = max(law.static_coefficient, law.kinetic_coefficient) * load_n
    ridges = float(np.abs(constants.ridges.amplitudes).sum())
    most_v = np.abs(constants.normal_v_n) * load_n * (1.0 + ridges)
    most_v = most_v + np.abs(constants.shear_v_n) * friction_n
    return float((np.abs(found.clean_v).max(axis=0) / most_v).max())


def _measure_long_run(simulated_s: float) -> dict[str, Any]:
    """Slide forth and back for a long time, and compare the last cycle with the second."""
    cycles = round(simulated_s / CYCLE_S) - 1
    description = {'steps': sliding_cycles(cycles), 'friction': {}, 'texture': {}}
    scene = build_scene(description, sample_rate_hz=HOUR_RATE_HZ)
    per_cycle = round(CYCLE_S * HOUR_RATE_HZ)
    volts = [solve_live(scene, per_cycle).clean_v for _ in range(scene.length // per_cycle)]
    return {
        'simulated_s': scene.duration_s,
        'cycles': cycles,
        'drift': float(np.abs(volts[-1] - volts[2]).max() / np.ptp(volts[2])),
    }
