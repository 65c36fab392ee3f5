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

"""Skin: what is let go moves as a mass on a damped spring."""

import numpy as np
import pytest
from scipy.linalg import expm

from slip_detector.scenes import Scene
from slip_detector.scenes.friction import Skin
from slip_detector.scenes.mechanics import DISPLACEMENT, VELOCITY

RATE_HZ = 20_000.0


def let_go(skin):
    """Return displacement and velocity of the skin over the taxels after the plate has left.

    Shape (n, 16, 2); the force rings below zero at once, so the plate leaves within a millisecond.
    """
    scene = Scene(
        {
            'sample_rate_hz': RATE_HZ,
            'motion': {'ringing_hz': 1000.0, 'acceleration_m_s2': 100.0},
            'steps': [
                {'duration_s': 0.05, 'force_n': 0.5},
                {'duration_s': 0.05, 'velocity_m_s': 0.01},
                {'duration_s': 0.001, 'force_n': 0.0},
                {'duration_s': 0.05},
            ],
            'friction': {'kinetic_coefficient': 0.5, 'static_coefficient': 0.5},
            'skin': skin.to_parameters(),
        },
        np.random.default_rng(0),
    )
    scene.clean(round(0.105 * RATE_HZ))
    states = []
    for _ in range(400):
        states.append(scene.state.patches[:, [DISPLACEMENT, VELOCITY]].copy())
        scene.clean(1)
    return np.array(states)


@pytest.mark.parametrize(
    'skin',
    [
        Skin(shear_stiffness_n_m=800.0, damping_n_s_m=8.0, mass_kg=0.0),
        Skin(shear_stiffness_n_m=800.0, damping_n_s_m=0.3, mass_kg=1e-3),
        Skin(shear_stiffness_n_m=800.0, damping_n_s_m=8.0, mass_kg=1e-3),
    ],
)
def test_skin_that_is_let_go_is_a_mass_on_a_damped_spring(skin):
    states = let_go(skin)
    stiffness, damping, mass = skin.numbers()
    t = np.arange(len(states)) / RATE_HZ
    if mass:
        rates = np.array([[0.0, 1.0], [-stiffness / mass, -damping / mass]])
        wanted_m = np.array([(expm(rates * s) @ states[0].T)[0] for s in t])
    else:
        wanted_m = np.exp(-stiffness / damping * t)[:, np.newaxis] * states[0, :, 0]
    assert np.abs(states[0, :, 0]).max() > 1e-6
    largest_m = np.abs(states[:, :, 0]).max()
    np.testing.assert_allclose(states[:, :, 0], wanted_m, atol=2e-3 * largest_m)


def test_the_numbers_are_those_of_the_parameters():
    skin = Skin(shear_stiffness_n_m=1.0, damping_n_s_m=2.0, mass_kg=0.5)
    assert skin.numbers() == (1.0, 2.0, 0.5)
