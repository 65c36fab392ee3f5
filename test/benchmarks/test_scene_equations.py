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

"""The equations of the mechanics, and their solutions by SciPy against the live stepper's."""

import functools

import pytest

from benchmarks.scenes.reference import Ode, build_scene, solve_live

STEPS = [
    {'duration_s': 0.03},
    {'duration_s': 0.05, 'force_n': 0.4},
    {'duration_s': 0.1},
    {'duration_s': 0.1, 'velocity_m_s': 6.7e-3},
    {'duration_s': 0.05},
    {'duration_s': 0.04, 'force_n': 0.0},
    {'duration_s': 0.03},
]
PLATE = {'steps': STEPS, 'friction': {}, 'texture': {}}
FILTERED = {**PLATE, 'electronics': {'bandwidth_hz': 150.0}}
OBJECT = {
    'steps': [
        {'duration_s': 0.05, 'force_n': 2.5},
        {'duration_s': 0.1},
        {'duration_s': 0.05, 'carried': 1.0},
        {'duration_s': 0.1, 'force_n': 1.0},
        {'duration_s': 0.2, 'force_n': 0.3},
    ],
    'friction': {},
    'texture': {},
    'object': {'mass_kg': 0.2, 'length_m': 0.02},
    'electronics': {'bandwidth_hz': 150.0},
}
DISTURBED = {
    **PLATE,
    'tremor': {'force_rms_n': 0.02, 'motion_rms_m': 5e-5},
    'taps': {'times_s': [0.1, 0.2, 0.35]},
    'rolling': {'start_s': 0.15, 'duration_s': 0.03, 'hold_s': 0.02, 'repeats': 2},
}
SHAKEN = {**OBJECT, 'tremor': {'motion_rms_m': 5e-5}}
SCENES = {
    'plate': PLATE, 'filtered': FILTERED, 'object': OBJECT,
    'disturbed': DISTURBED, 'shaken': SHAKEN,
}  # fmt: skip


@functools.cache
def reference(name):
    """Return the solution of a scene's equations, found once for all tests."""
    return Ode(build_scene(SCENES[name])).solve('LSODA', 1e-8)


@pytest.mark.parametrize('name', SCENES)
def test_the_live_stepper_comes_to_the_equation_s_solution_with_the_square_of_its_step(name):
    solution = reference(name)
    errors = []
    for step_s in (6e-4, 1.5e-4):
        found = solve_live(build_scene(SCENES[name], step_s=step_s), len(solution.clean_v))
        errors.append(solution.error(found))
        assert solution.error_m(found) < 2e-5
    assert errors[1] < 2e-3
    # Where contact is made or lost a step is off by more than its square.
    assert errors[1] < errors[0] / 3.0


def test_a_solution_ends_where_the_object_is_lost():
    scene, solution = build_scene(OBJECT), reference('object')
    length_m = OBJECT['object']['length_m']
    assert len(solution.clean_v) < scene.length
    assert 0.8 * length_m < solution.position_m[-1] <= length_m
