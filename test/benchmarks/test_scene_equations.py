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

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from benchmarks.extremes.cases import LIFT_OFF, moving
from benchmarks.scenes.build import build_scene
from benchmarks.scenes.equations import DIFFERENCE
from benchmarks.scenes.integrators import (
    live_onset_s,
    showing_shears,
    solve,
)
from benchmarks.scenes.ode import Ode
from slip_detector.scenes.friction import Friction
from slip_detector.scenes.mechanics import LEAST, STORED, WORK

ALL = 10**9

STEPS = [
    {'duration_s': 0.03},
    {'duration_s': 0.05, 'force_n': 0.4},
    {'duration_s': 0.1},
    {'duration_s': 0.1, 'velocity_m_s': 6.7e-3},
    {'duration_s': 0.05},
    {'duration_s': 0.04, 'force_n': 0.0},
    {'duration_s': 0.03},
]
START_S = 0.18
PLATE = {'steps': STEPS, 'friction': {}, 'texture': {}}
FILTERED = {**PLATE, 'electronics': {'bandwidth_hz': 150.0}}
HEAVY = {**PLATE, 'skin': {'mass_kg': 1e-5}}
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
    'plate': PLATE, 'filtered': FILTERED, 'heavy': HEAVY, 'object': OBJECT,
    'disturbed': DISTURBED, 'shaken': SHAKEN,
}  # fmt: skip


@functools.cache
def reference(name, tolerance=1e-8):
    """Return a scene's equations and their solution, found once for all tests."""
    ode = Ode(build_scene(SCENES[name]))
    return ode, solve(ode, 'LSODA', tolerance)


@pytest.mark.parametrize('name', SCENES)
def test_the_jacobian_is_that_of_the_rates(name):
    ode = Ode(build_scene(SCENES[name]))
    solution = solve(ode, 'LSODA', 1e-6)
    t = 0.25
    y = solution.states[round(t * 380)]
    ode.side_s = t
    jacobian = ode.jacobian(t, y)
    base = ode.rates(t, y)
    for j in range(ode.size):
        changed = y.copy()
        changed[j] += DIFFERENCE * ode.scales[j]
        column = (ode.rates(t, changed) - base) / (DIFFERENCE * ode.scales[j])
        scale = np.abs(column).max() + 1e-12 * np.abs(jacobian).max()
        np.testing.assert_allclose(jacobian[:, j] / scale, column / scale, atol=1e-3)
    if not ode.with_object:
        bands = ode.bands()
        rows, columns = np.nonzero(jacobian)
        assert np.max(rows - columns) <= bands['lband']
        assert np.max(columns - rows) <= bands['uband']


@pytest.mark.parametrize('name', SCENES)
def test_the_live_stepper_comes_to_the_equation_s_solution_with_the_square_of_its_step(name):
    solution = reference(name)[1]
    n = len(solution.time_s)
    errors = []
    for step_s in (6e-4, 1.5e-4):
        _, clean_v, position_m, _ = build_scene(SCENES[name], step_s=step_s).clean(n)
        errors.append(np.abs(clean_v - solution.clean_v).max() / np.ptp(solution.clean_v))
        np.testing.assert_allclose(position_m, solution.position_m, atol=2e-5)
    assert errors[1] < 2e-3
    # Where contact is made or lost a step is off by more than its square.
    assert errors[1] < errors[0] / 3.0


@pytest.mark.parametrize('name', ['plate', 'heavy', 'object'])
def test_implicit_methods_agree(name):
    ode, whole = reference(name)
    other = solve(ode, 'BDF', 1e-6)
    range_v = np.ptp(whole.clean_v)
    assert np.abs(other.clean_v - whole.clean_v).max() < 1e-4 * range_v
    assert other.lost_s == pytest.approx(whole.lost_s, abs=1e-5)
    # Radau's Newton iteration takes long over changes between sticking and sliding.
    first, last = round(0.22 * 380), round(0.26 * 380)
    part = solve(ode, 'Radau', 1e-5, (first, last), whole.states[first])
    assert np.abs(part.clean_v - whole.clean_v[first : last + 1]).max() < 1e-4 * range_v


@pytest.mark.parametrize('method', ['RK45', 'DOP853'])
def test_explicit_methods_agree_over_a_stretch_from_the_same_state(method):
    ode, whole = reference('plate', 1e-9)
    first, last = round((START_S + 0.005) * 380), round((START_S + 0.03) * 380)
    part = solve(ode, method, 1e-5, (first, last), whole.states[first])
    rows = slice(first, last + 1)
    np.testing.assert_array_equal(part.time_s, whole.time_s[rows])
    far_v = np.abs(part.clean_v - whole.clean_v[rows]).max()
    assert far_v < 1e-4 * np.ptp(whole.clean_v)


def test_onsets_are_those_of_the_live_stepper():
    ode, solution = reference('plate')
    onset_s = live_onset_s(
        build_scene(showing_shears(PLATE, build_scene(PLATE, step_s=1e-4))), ode
    )
    assert np.all(np.isfinite(solution.onset_s))
    assert solution.onset_s.min() > START_S
    np.testing.assert_allclose(onset_s, solution.onset_s, atol=1e-5)


def test_a_solution_ends_where_the_object_is_lost():
    ode = Ode(build_scene(OBJECT))
    solution = solve(ode, 'BDF', 1e-6)
    assert solution.lost_s < ode.scene.duration_s
    assert solution.time_s[-1] <= solution.lost_s < solution.time_s[-1] + 1 / 380
    assert solution.position_m[-1] <= OBJECT['object']['length_m']
    assert solution.position_m[-1] > 0.8 * OBJECT['object']['length_m']


@settings(max_examples=10)
@given(st.floats(1e3, 1e7), st.floats(1e-2, 1.0), st.floats(-0.05, 0.05))
def test_the_live_stepper_agrees_whatever_the_bristles(stiffness, damping, velocity_m_s):
    steps = [*STEPS[:3], {'duration_s': 0.15, 'velocity_m_s': velocity_m_s}]
    description = {
        'steps': steps,
        'motion': {'acceleration_m_s2': 5.0},
        'friction': {'bristle_stiffness_n_m': stiffness, 'bristle_damping_n_s_m': damping},
    }
    solution = solve(Ode(build_scene(description)), 'BDF', 1e-6)
    _, clean_v, _, _ = build_scene(description, step_s=1e-4).clean(ALL)
    assert np.abs(clean_v - solution.clean_v).max() < 2e-3 * np.ptp(solution.clean_v)


@settings(max_examples=25)
@example(5.0, 0.0, 1e-5, [0.0625], 1e-4, False)
@example(5.18, 0.0, 0.0, [3.9e-3], 3.5e-4, False)
@given(
    st.floats(3.0, 9.0),
    st.floats(0.0, 10.0),
    st.sampled_from([0.0, 1e-8, 1e-5, 1e-3]),
    st.lists(st.floats(2e-3, 0.08) | st.floats(-0.08, -2e-3), min_size=1, max_size=3),
    st.sampled_from([2.7e-3, 3.5e-4, 1e-4]),
    st.booleans(),
)
def test_sliding_friction_never_gives_more_than_it_got(
    log_stiffness, bristle_damping, mass_kg, velocities, step_s, lifts
):
    scene = build_scene(
        {
            'steps': LIFT_OFF if lifts else moving(*velocities),
            'motion': {'acceleration_m_s2': 20.0},
            'friction': {
                'bristle_stiffness_n_m': 10.0**log_stiffness,
                'bristle_damping_n_s_m': bristle_damping,
            },
            'skin': {'mass_kg': mass_kg},
        },
        step_s=step_s,
    )
    ledger = np.zeros(3)
    _, clean_v, _, sliding = scene.clean(ALL, ledger)
    assert np.isfinite(clean_v).all()
    assert np.all((sliding >= 0.0) & (sliding <= 1.0))
    # While bristles still stick, a step's work and what it stores differ by 0.05 sigma0 (h w)^2
    # at most: some 1e-4 of what they can store before they slide, in all that was tried.
    bend_j = 0.5 * (Friction().static_coefficient * 0.4) ** 2 / 10.0**log_stiffness
    assert ledger[LEAST] >= -1e-9 * ledger[WORK] - 1e-3 * bend_j
    assert 0.0 <= ledger[STORED] <= ledger[WORK] * (1.0 + 1e-9)
