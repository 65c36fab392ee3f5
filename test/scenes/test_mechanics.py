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

"""Mechanics: the stepper solves skin and friction, at any cut, and makes no energy."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.scenes import Scene
from slip_detector.scenes.friction import LIGHTEST_LOAD_N
from slip_detector.scenes.mechanics import DEFLECTION, DISPLACEMENT
from support.interpreted import interpreted

ALL = 10**9

# Whatever the defaults are: these are the numbers that the tests count on.
# At 1 N the outer eight taxels lie near the edge of the contact.
CONTACT = {'radius_at_1n_m': 2.2e-3, 'taxel_area_m2': 3e-7}
MOTION = {'acceleration_m_s2': 0.5, 'ringing_hz': 20.0, 'ringing_damping': 0.7}
SKIN = {'shear_stiffness_n_m': 500.0, 'damping_n_s_m': 0.3}
LUGRE = {
    'model': 'lugre',
    'kinetic_coefficient': 0.5,
    'static_coefficient': 0.6,
    'stribeck_velocity_m_s': 10e-3,
    'bristle_stiffness_n_m': 1e5,
    'bristle_damping_n_s_m': 0.1,
    'unloading_s': 1e-4,
}


# Any cut.

ALL_PARTS = {
    'sample_rate_hz': 200.0,
    'step_s': 1e-3,
    'contact': CONTACT,
    'skin': SKIN,
    'friction': {**LUGRE, 'static_coefficient': 0.52},
    'texture': {'ridge_height_m': 5e-5, 'harmonics': [0.1, 0.1], 'indentation_m': 1e-3},
    'roughness': {},
    'electronics': {'bandwidth_hz': 60.0, 'drift_v': 0.01, 'noise_v': 1e-3, 'adc_bits': 12},
    'hum': {},
    'tremor': {},
    'taps': {'times_s': [0.3], 'duration_s': 0.05},
    'rolling': {'start_s': 0.35, 'duration_s': 0.1},
    'faults': {'dead_channels': [1], 'from_s': 0.3},
    'contact_noise': {},
}
ON_A_PLATE = [
    {'duration_s': 0.1, 'force_n': 0.5},
    {'duration_s': 0.2},
    {'duration_s': 0.2, 'velocity_m_s': 10e-3},
    {'duration_s': 0.1, 'force_n': 0.0},
]
AN_OBJECT = [
    {'duration_s': 0.1, 'force_n': 2.0},
    {'duration_s': 0.1, 'carried': 1.0},
    {'duration_s': 0.2, 'pull_n': 1.5},
    {'duration_s': 0.2, 'force_n': 0.0},
]
WHOLE_SCENES = {
    'plate': {**ALL_PARTS, 'steps': ON_A_PLATE, 'motion': MOTION},
    'object': {**ALL_PARTS, 'steps': AN_OBJECT, 'motion': MOTION, 'object': {'mass_kg': 0.1}},
    'bare': {'steps': ON_A_PLATE, 'motion': MOTION, 'texture': ALL_PARTS['texture']},
}


@settings(max_examples=20)
@given(st.sampled_from(sorted(WHOLE_SCENES)), st.lists(st.integers(0, 60), max_size=12))
def test_any_cut_of_a_scene_gives_the_same_bits(name, cuts):
    description = WHOLE_SCENES[name]
    whole = Scene(description, np.random.default_rng(0)).read(ALL)
    cut = Scene(description, np.random.default_rng(0))
    pieces = [cut.read(n) for n in [*cuts, ALL, 1]]
    for field in ('volts', 'stamps_ns', 'truth', 'position_m'):
        joined = np.concatenate([getattr(piece, field) for piece in pieces])
        assert joined.tobytes() == getattr(whole, field).tobytes(), field
    assert len(pieces[-1].volts) == 0


def test_without_numba_a_scene_is_the_same():
    short = [{'duration_s': 0.05, 'force_n': 1.0}, {'duration_s': 0.1, 'velocity_m_s': 10e-3}]
    plain_v, compiled_v = (
        kind({**ALL_PARTS, 'steps': short}, np.random.default_rng(0)).clean(ALL)[1]
        for kind in (interpreted('scenes.scene').Scene, Scene)
    )
    np.testing.assert_allclose(plain_v, compiled_v, rtol=1e-9, atol=1e-12)


# Sticking and sliding.


def test_after_lift_off_while_sliding_the_skin_goes_back_to_rest():
    # Touched at 0.05 s, pushed at 0.6 s: until then the force has settled.
    steps = [
        {'duration_s': 0.05},
        {'duration_s': 0.05, 'force_n': 1.0},
        {'duration_s': 0.5},
        {'duration_s': 0.3, 'velocity_m_s': 10e-3},
        {'duration_s': 0.05, 'force_n': 0.0, 'velocity_m_s': 10e-3},
        {'duration_s': 2.0, 'velocity_m_s': 10e-3},
    ]
    shear_only = {'normal_v_n': 0.0, 'shear_v_n': 1.0, 'shear_along_share': 1.0}
    description = {
        'steps': steps, 'contact': CONTACT, 'motion': MOTION, 'skin': SKIN, 'friction': LUGRE,
        'electronics': {**shear_only, 'spread': 0.0, 'noise_v': 0.0, 'bandwidth_hz': 0.0},
    }  # fmt: skip
    played = Scene(description, np.random.default_rng(0))
    _, clean_v, _, sliding = played.clean(ALL)
    assert clean_v.max() > 1e-3
    # Friction is left as of the lightest load, below what a taxel feels.
    left_n = 0.6 * LIGHTEST_LOAD_N
    shears_n = SKIN['shear_stiffness_n_m'] * played.state.patches[:, DISPLACEMENT]
    bristles_n = LUGRE['bristle_stiffness_n_m'] * played.state.patches[:, DEFLECTION]
    assert np.abs(shears_n).max() <= 1.001 * left_n + 1e-12
    assert np.abs(bristles_n).max() <= 1.001 * left_n
    assert sliding[-1] == 0.0
    for array in played.state:
        sizes = np.abs(array[array != 0.0])
        assert np.all(np.isfinite(sizes))
        assert np.all(sizes > np.finfo(float).tiny)
