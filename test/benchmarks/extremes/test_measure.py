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

"""The extremes: all stays finite and bounded, friction gives no energy, errors are small."""

import functools

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from benchmarks.extremes.cases import LIFT_OFF, Case, cases, moving
from benchmarks.extremes.measure import ALL, measure_case, measure_long_run
from benchmarks.scenes.build import build_scene
from slip_detector.scenes.friction import Friction
from slip_detector.scenes.mechanics import LEAST, STORED, WORK

CASES = cases()


REFUSED = [
    ('bristles', 'RK45', 'RK45: would need about'),
    ('bristles', 'DOP853', 'DOP853: would need about'),
    ('coulomb', 'BDF', 'friction: model is coulomb'),
    ('coulomb', 'RK45', 'friction: model is coulomb'),
    ('no mass, no damping', 'Radau', 'skin: mass_kg and damping_n_s_m are 0'),
]


FORCE_N = max(step.get('force_n', 0.0) for step in LIFT_OFF)


STATIC_COEFFICIENT = Friction().static_coefficient


def names(case):
    return f'{case.case}: {case.setting}'


LIVE = {names(case): case for case in CASES if case.method == 'live'}


@functools.cache
def live_row(name):
    """Run a case without a reference, once for all tests."""
    return measure_case(LIVE[name], with_reference=False)


@pytest.mark.parametrize('name', LIVE)
def test_the_live_stepper_stays_finite_and_bounded_and_makes_no_energy(name):
    row = live_row(name)
    if row['said']:
        assert 'allowed: ' in row['said']
        assert '\n' not in row['said']
        return
    assert row['finite']
    assert row['bounded']
    # Less than the work's own round-off, but for a light skin that rings undamped.
    assert row['energy_created'] <= (
        1e-9 if 'mass_kg' in dict(LIVE[name].more).get('skin', {}) else 1e-12
    )


def test_only_what_has_no_motion_to_compute_is_refused():
    live = [live_row(name) for name in LIVE]
    assert len(live) == sum(case.method == 'live' for case in CASES)
    assert [(row['case'], row['setting']) for row in live if row['said']] == [
        ('no mass, no damping', 'damped bristles'),
        ('no mass, no damping', 'Stribeck effect'),
        ('spatial period', '1 um, no low-pass'),
        ('velocity', '80 mm/s, no low-pass'),
    ]


@pytest.mark.parametrize(
    ('case', 'setting', 'error'),
    [
        ('bristles', 'sigma0 1e+03 N/m', 3e-4),
        ('bristles', 'sigma0 1e+07 N/m', 3e-4),
        ('lift-off', 'while it slides', 5e-4),
        ('lift-off', 'bouncing', 2e-3),
        ('reversal', '20 mm/s, 1000 m/s2', 1e-2),
        ('no mass, no damping', 'no Stribeck effect', 5e-4),
        ('mass', '1e-5 kg', 5e-4),
        ('sample rate', '500 Hz', 2e-3),
        ('object', '200 g', 5e-4),
        ('object', '10000 g', 3e-3),
        ('coulomb', 'texture', 5e-4),
    ],
)
def test_the_error_against_the_reference_is_small(case, setting, error):
    (found,) = [c for c in CASES if (c.case, c.setting, c.method) == (case, setting, 'live')]
    row = measure_case(found)
    assert row['voltage_error'] < error
    assert row['reference_error'] is None or row['reference_error'] < error / 3.0
    if case == 'object':
        assert row['position_error_m'] < 1e-4


@pytest.mark.parametrize(('case', 'method', 'said'), REFUSED)
def test_what_a_method_cannot_do_it_says_before_it_starts(case, method, said):
    found = [c for c in CASES if (c.case, c.method) == (case, method)]
    assert found
    for one in found:
        row = measure_case(one)
        assert row['said'].startswith(said)
        assert 'allowed: ' in row['said']
        assert row['voltage_error'] is row['finite'] is None


def test_a_refusal_that_does_not_come_is_an_error():
    with pytest.raises(RuntimeError, match='BDF did not refuse plain, nothing'):
        measure_case(Case('plain', 'nothing', {}, 'BDF'))


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
    bend_j = 0.5 * (STATIC_COEFFICIENT * FORCE_N) ** 2 / 10.0**log_stiffness
    assert ledger[LEAST] >= -1e-9 * ledger[WORK] - 1e-3 * bend_j
    assert 0.0 <= ledger[STORED] <= ledger[WORK] * (1.0 + 1e-9)


@given(st.floats(1e-9, 1e-4), st.sampled_from([2.7e-3, 3.5e-4]), st.floats(4.0, 7.0))
@settings(max_examples=15)
def test_bristles_that_only_bend_give_back_what_they_got_and_no_more(
    velocity_m_s, step_s, log_stiffness
):
    # A step's work and the energy it stores differ by so much of sigma0 (h w)^2 at most, forth
    # and back: it does not add up.
    ledgers = []
    for cycles in (1, 20):
        scene = build_scene(
            {
                'steps': moving(*[velocity_m_s, -velocity_m_s] * cycles, seconds=0.02),
                'motion': {'acceleration_m_s2': 1.0},
                'friction': {
                    'bristle_stiffness_n_m': 10.0**log_stiffness, 'bristle_damping_n_s_m': 0.0,
                },
            },
            step_s=step_s,
        )  # fmt: skip
        ledger = np.zeros(3)
        scene.clean(ALL, ledger)
        ledgers.append(ledger)
        most_j = 0.05 * 16 * 10.0**log_stiffness * (scene.constants.step_s * velocity_m_s) ** 2
        assert ledger[LEAST] >= -most_j
    assert ledgers[1][LEAST] >= 2.0 * ledgers[0][LEAST] - 1e-6 * most_j


def test_long_runs_neither_drift_nor_grow():
    figures = measure_long_run(60.0)
    assert figures['finite']
    assert figures['cycles'] == 29
    assert figures['drift'] < 1e-9
    assert figures['work_growth'] < 1e-8
    assert figures['energy_created'] <= 1e-12
