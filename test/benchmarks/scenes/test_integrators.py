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

"""Scenes solved by SciPy's integrators: the same mechanics as the live stepper's."""

import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.scenes.build import build_scene
from benchmarks.scenes.integrators import (
    IMPLICIT,
    BudgetSpentError,
    live_onset_s,
    refuse_impossible,
    showing_shears,
    solve,
)
from benchmarks.scenes.ode import Ode
from support.benchmark_scenes import OBJECT, PLATE, SCENES, START_S, STEPS

ALL = 10**9


@functools.cache
def reference(name, tolerance=1e-8):
    """Return a scene's equations and their solution, found once for all tests."""
    ode = Ode(build_scene(SCENES[name]))
    return ode, solve(ode, 'LSODA', tolerance)


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


def test_nothing_that_moves_has_no_onset():
    still = [step | {'velocity_m_s': 0.0} for step in STEPS]
    assert np.isnan(solve(Ode(build_scene(PLATE, steps=still)), 'LSODA', 1e-4).onset_s).all()


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


@pytest.mark.parametrize('method', ['RK45', 'DOP853'])
def test_an_explicit_method_says_how_many_steps_it_would_need(method):
    ode = Ode(build_scene(PLATE, friction={'bristle_stiffness_n_m': 1e9}))
    with pytest.raises(ValueError, match=f'{method}: would need about .* steps') as caught:
        solve(ode, method, 1e-3)
    assert 'allowed: up to 5e+06 steps, or LSODA, BDF, Radau' in str(caught.value)
    for implicit in IMPLICIT:
        refuse_impossible(ode, implicit, (0.0, 1.0))


def test_an_unknown_method_is_named_with_those_there_are():
    with pytest.raises(ValueError, match='unknown method Euler, allowed: RK45, DOP853, LSODA'):
        solve(Ode(build_scene(PLATE)), 'Euler', 1e-3)


def test_a_method_gives_up_when_its_time_is_over():
    with pytest.raises(BudgetSpentError, match='RK45: given up after 0'):
        solve(Ode(build_scene(PLATE)), 'RK45', 1e-3, budget_s=0.05)
