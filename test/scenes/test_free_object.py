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

"""A free object: held, let slip, caught, lost and dropped as its weight and the grip say."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes.test_mechanics import LUGRE

from slip_detector.scenes import Scene
from slip_detector.scenes.friction import LIGHTEST_LOAD_N
from slip_detector.scenes.surface import STANDARD_GRAVITY_M_S2

ALL = 10**9
G = STANDARD_GRAVITY_M_S2

# Whatever the defaults are: these are the numbers that the tests count on.
REST = 50.0
STIFFNESS_N_M = 1000.0
PARTS = {
    'sample_rate_hz': 1000.0,
    'step_s': 5e-4,
    'motion': {'acceleration_m_s2': 0.5, 'ringing_hz': 40.0, 'ringing_damping': 1.0},
    'contact': {'radius_at_1n_m': 5e-3, 'taxel_area_m2': 1e-6},
    'skin': {'shear_stiffness_n_m': STIFFNESS_N_M, 'damping_n_s_m': 1.0},
}
ONE_COEFFICIENT = {**LUGRE, 'static_coefficient': 0.5}
TWO_COEFFICIENTS = {**LUGRE, 'stribeck_velocity_m_s': 0.1}
FRICTIONS = [ONE_COEFFICIENT, TWO_COEFFICIENTS]

#: Gripped before 0.6 s, loaded with the object's weight until then.
HELD_S = 0.6


def held(grip_n, after, *, mass_kg=0.2, length_m=10.0, friction=ONE_COEFFICIENT, **parts):
    """Return a scene in which an object is gripped and carried before what comes ``after``."""
    steps = [
        {'duration_s': 0.1, 'force_n': grip_n},
        {'duration_s': 0.3},
        {'duration_s': 0.2, 'carried': 1.0},
        *after,
    ]
    description = {
        **PARTS, 'steps': steps, 'friction': friction,
        'object': {'mass_kg': mass_kg, 'length_m': length_m, 'rest_patches': REST}, **parts,
    }  # fmt: skip
    return Scene(description, np.random.default_rng(0))


MASSES_KG = st.floats(-3.0, 1.0).map(lambda exponent: 10.0**exponent)


@settings(max_examples=15)
@given(MASSES_KG, st.floats(1.1, 4.0), st.sampled_from(FRICTIONS))
def test_an_object_is_held_where_friction_of_both_fingers_exceeds_its_weight(
    mass_kg, surplus, friction
):
    weight_n = mass_kg * G
    grip_n = surplus * weight_n / (2.0 * 0.5)
    # A heavy object's skin must not chatter.
    skin = {**PARTS['skin'], 'damping_n_s_m': 10.0}
    scene = held(grip_n, [{'duration_s': 1.0}], mass_kg=mass_kg, friction=friction, skin=skin)
    time_s, _, position_m, sliding = scene.clean(ALL)
    at_rest = time_s > HELD_S + 0.5
    # The pressure sinks to nothing at the edge of the contact, so that some patches there slide;
    # those that stick carry the rest, and give way further. Nothing moves on.
    assert np.ptp(position_m[at_rest]) < 1e-7
    # The skin of both fingers and the bristles give way.
    stretch_m = weight_n / (2.0 * (16 + REST)) * (1.0 / STIFFNESS_N_M + 1.0 / 1e5)
    assert position_m[-1] < 5.0 * stretch_m + 5e-6
    assert np.all(sliding[at_rest] == 0.0)


@settings(max_examples=15)
@given(MASSES_KG, st.floats(0.1, 0.8), st.sampled_from(FRICTIONS))
def test_an_object_too_heavy_for_the_grip_accelerates_as_newton_says(mass_kg, share, friction):
    weight_n = mass_kg * G
    grip_n = share * weight_n / (2.0 * 0.6)
    skin = {**PARTS['skin'], 'damping_n_s_m': 10.0}
    scene = held(grip_n, [{'duration_s': 0.8}], mass_kg=mass_kg, friction=friction, skin=skin)
    time_s, _, position_m, sliding = scene.clean(ALL)
    # Long after the Stribeck velocity friction is kinetic.
    late = time_s > HELD_S + 0.5
    wanted = (weight_n - 2.0 * 0.5 * grip_n) / mass_kg
    # The friction of patches without load may take a little off.
    lightest = 2.0 * (16 + REST) * 0.6 * LIGHTEST_LOAD_N / mass_kg
    parabola = np.polynomial.Polynomial.fit(time_s[late], position_m[late], 2).convert()
    assert 2.0 * parabola.coef[2] == pytest.approx(wanted, rel=1e-3, abs=lightest)
    assert np.all(sliding[late] > 0.99)


def test_an_object_that_slid_through_is_lost_and_felt_no_more():
    length_m = 0.02
    scene = held(3.0, [{'duration_s': 0.5}, {'duration_s': 1.0, 'force_n': 3.0}],
                 mass_kg=1.0, length_m=length_m)  # fmt: skip
    _, clean_v, position_m, sliding = scene.clean(ALL)
    assert length_m < position_m[-1] < length_m + 2e-3
    np.testing.assert_array_equal(position_m[-500:], position_m[-1])
    assert np.abs(clean_v[-500:]).max() < 1e-4
    np.testing.assert_array_equal(sliding[-500:], 0.0)


@given(st.floats(0.0, 5.0), st.integers(1, 400))
@settings(max_examples=10)
def test_a_grip_from_outside_changes_nothing_that_was_before(grip_n, at):
    plain = held(3.0, [{'duration_s': 0.3}])
    steered = held(3.0, [{'duration_s': 0.3}])
    before = [scene.clean(at) for scene in (plain, steered)]
    for plain_array, steered_array in zip(*before, strict=True):
        assert plain_array.tobytes() == steered_array.tobytes()
    steered.hold_force(grip_n)
    settled_s = np.array([at / 1000.0 + 1.0])
    assert steered.force_n(settled_s)[0] == pytest.approx(grip_n, abs=1e-6)
    assert len(steered.clean(ALL)[0]) == plain.length - at


@pytest.mark.parametrize(
    ('force_n', 'said'),
    [
        (-1e-3, 'force_n is -0.001 N, allowed: 0 to 1000 N'),
        (1e4, 'force_n is 10000 N, allowed: 0 to 1000 N'),
        (1000.0, 'a grip of 1000 N: the skin would chatter, .*, allowed: more damping'),
    ],
)
def test_a_grip_out_of_range_or_under_which_the_skin_would_chatter_is_refused(force_n, said):
    steep = {**TWO_COEFFICIENTS, 'stribeck_velocity_m_s': 10e-3}
    scene = held(1.0, [{'duration_s': 0.3}], mass_kg=0.05, friction=steep)
    with pytest.raises(ValueError, match=said) as caught:
        scene.hold_force(force_n)
    assert '\n' not in str(caught.value)
    scene.hold_force(2.0)
