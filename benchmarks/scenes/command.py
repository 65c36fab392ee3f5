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

"""Error against run time of the scenes, for the live stepper and SciPy's integrators.

The reference of each scene is BDF at a relative tolerance of 1e-10, checked by LSODA. Voltage
errors are the worst over samples and channels, as a share of the range of the reference's volts
(clean: without baselines, noise and faults). Run times are processor times on one core, without
compilation. SciPy's methods get compiled rates.

Keys of ``python -m benchmarks scenes --json``:

``precision``
    One object for each scene: ``scene``; ``note``: why there is nothing to compare, else empty;
    ``reference``: how far its check differs from it, ``voltage_error`` and ``position_error_m``;
    and ``runs``: ``method`` (``live`` is the live stepper), ``setting``, ``voltage_error``,
    ``position_error_m`` of an object, ``run_time_per_s`` (for a simulated second), and ``said``:
    why a method gave up, without figures. ``shipped_live`` is the run of the live stepper with the
    step of the shipped scene.
``plate``
    ``speed`` of the plate (times real time).
"""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.measurement import Bound, shared_options
from benchmarks.pictures import draw_work_precision
from benchmarks.scenes.reference import Ode, Solution, build_scene, solve_live
from slip_detector.parameters import read_yaml, shared_folder
from slip_detector.scenes import find_scene

WANTED = {'plate.speed': Bound(low=50.0)}

#: The scene for which speed is wanted.
PLATE = 'plate_400um'

#: The reference and its check, and the processor time that each is given.
REFERENCES = ('BDF', 'LSODA')
REFERENCE_RTOL, REFERENCE_BUDGET_S = 1e-10, 120.0

#: Processor time that a method is given for a scene.
BUDGET_S = 4.0


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'scenes',
        "Measure errors and run times of the live stepper and of SciPy's integrators on the "
        'shipped scenes against a tight reference.',
        picture='scenes_work_precision.png',
    )
    parser.add_argument(
        '--scene', action='append', default=[], metavar='NAME',
        help='measure only this scene; repeatable',
    )  # fmt: skip
    return parser


def measure(words: argparse.Namespace) -> dict[str, Any]:
    """Measure errors and run times."""
    folder = shared_folder() / 'config' / 'scenes'
    shipped = sorted(path.stem for path in folder.glob('*.yaml'))
    precision = [_precision(find_scene(name), words.quick) for name in words.scene or shipped]
    if words.plot:
        draw(words.plot, precision)
    live = {one['scene']: one['shipped_live'] for one in precision}
    return {
        'precision': precision,
        'plate': {'speed': 1 / live[PLATE]['run_time_per_s']} if PLATE in live else {},
    }


def draw(path: Path, precision: list[dict[str, Any]]) -> None:
    """Draw voltage error against run time of all methods, in a panel for each scene."""
    panels: dict[str, dict[str, list[tuple[float, float]]]] = {}
    for entry in precision:
        for run in entry['runs']:
            if not run['said']:
                runs = panels.setdefault(entry['scene'], {}).setdefault(run['method'], [])
                runs.append((run['voltage_error'], run['run_time_per_s'] * 1e3))
    error_label = 'worst voltage error / range of the volts'
    draw_work_precision(path, panels, error_label, 'run time for a simulated second [ms]')


def _precision(path: Path, quick: bool) -> dict[str, Any]:
    """Measure the errors and run times of all methods on one scene."""
    description = read_yaml(path)
    scene = build_scene(description)
    ode = Ode(scene)
    entry: dict[str, Any] = {
        'scene': path.stem, 'note': '', 'reference': None, 'runs': [], 'shipped_live': None,
    }  # fmt: skip
    if not ode.size:
        return entry | {'note': 'no friction and no low-pass: its volts are a closed form'}
    try:
        reference, check = (
            ode.solve(method, REFERENCE_RTOL, REFERENCE_BUDGET_S) for method in REFERENCES
        )
    except RuntimeError as error:
        return entry | {'note': f'there is no reference: {error}'}
    entry['reference'] = _errors(reference, check, ode.with_object)
    rounds = 1 if quick else 5
    entry['runs'] = [
        _live_run(description, steps, reference, ode, rounds)
        for steps in ((1, 8) if quick else (1, 2, 3, 4, 6, 8, 16, 32, 64))
    ]
    entry['shipped_live'] = _live_run(
        description, scene.constants.steps_per_sample, reference, ode, rounds
    )
    for method in REFERENCES:
        for rtol in (1e-3, 1e-6) if quick else (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8):
            run: dict[str, Any] = {'method': method, 'setting': f'rtol {rtol:g}', 'said': ''}
            try:
                found = ode.solve(method, rtol, BUDGET_S)
            except RuntimeError as error:
                entry['runs'].append(run | {'said': str(error)})
                continue
            run |= _errors(reference, found, ode.with_object)
            entry['runs'].append(run | {'run_time_per_s': found.run_time_s / scene.duration_s})
    return entry


def _errors(reference: Solution, found: Solution, with_object: bool) -> dict[str, float | None]:
    position_error_m = reference.error_m(found) if with_object else None
    return {'voltage_error': reference.error(found), 'position_error_m': position_error_m}


def _live_run(
    description: Mapping[str, Any], steps: int, reference: Solution, ode: Ode, rounds: int
) -> dict[str, Any]:
    """Run the live stepper with a number of steps for a sample."""
    step_s = (1.0 + 1e-6) / (ode.scene.sample_rate_hz * steps)
    n = len(reference.clean_v)
    scene = build_scene(description, step_s=step_s)
    found = solve_live(scene, n)
    more = (solve_live(build_scene(description, step_s=step_s), n) for _ in range(rounds))
    least_s = min(one.run_time_s for one in more)
    return {
        'method': 'live',
        'setting': f'{scene.constants.steps_per_sample} steps a sample',
        'said': '',
        **_errors(reference, found, ode.with_object),
        'run_time_per_s': least_s * scene.sample_rate_hz / n,
    }
