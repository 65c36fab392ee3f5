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

"""A scene as a differential equation."""

import re

import numpy as np
import pytest

from benchmarks.scenes.build import build_scene
from benchmarks.scenes.integrators import INTEGRATORS, solve
from benchmarks.scenes.ode import Ode
from support.benchmark_scenes import PLATE, START_S, STEPS


@pytest.mark.parametrize('method', INTEGRATORS)
@pytest.mark.parametrize(
    ('description', 'said'),
    [
        ({**PLATE, 'friction': 'coulomb'}, 'friction: model is coulomb'),
        (
            {
                **PLATE,
                'skin': {'damping_n_s_m': 0.0},
                'friction': {
                    'static_coefficient': 0.6, 'kinetic_coefficient': 0.6,
                    'bristle_damping_n_s_m': 0.0,
                },
            },
            'skin: mass_kg and damping_n_s_m are 0',
        ),
        ({'steps': STEPS}, 'no friction and no low-pass: its volts are a closed form'),
    ],
)  # fmt: skip
def test_what_no_equation_says_is_refused(method, description, said):
    with pytest.raises(ValueError, match=re.escape(said)) as caught:
        solve(Ode(build_scene(description)), method, 1e-3)
    assert 'allowed: ' in str(caught.value)
    assert '\n' not in str(caught.value)


def test_the_drive_is_smooth_between_its_corners_and_contact_is_one():
    scene = build_scene(PLATE)
    corners_s = Ode(scene).corners_s()
    assert np.all(np.diff(corners_s) > 0.0)
    # The force rises from 0.03 s on and ends to fall at 0.37 s, but for its ringing.
    made_s, lost_s = (time_s for time_s in corners_s if min(abs(scene.corners_s() - time_s)) > 0.0)
    assert made_s == pytest.approx(0.03, abs=1e-6)
    assert lost_s == pytest.approx(0.37, abs=5e-3)
    touches = scene.force_n(np.array([made_s, made_s + 1e-6, lost_s - 1e-6, lost_s])) > 0.0
    assert touches.tolist() == [True, True, True, False]


def test_the_motion_begins_with_the_step_that_moves():
    assert Ode(build_scene(PLATE)).moving_s() == pytest.approx(START_S)
    still = [step | {'velocity_m_s': 0.0} for step in STEPS]
    assert Ode(build_scene(PLATE, steps=still)).moving_s() == np.inf
