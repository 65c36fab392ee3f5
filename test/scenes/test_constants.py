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

"""The constants: equal steps, short enough for the skin, and nothing for what is not named."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.scenes.constants import scene_constants
from slip_detector.scenes.contact import Contact
from slip_detector.scenes.electronics import Electronics, Frontend
from slip_detector.scenes.free_object import FreeObject
from slip_detector.scenes.friction import Friction, Skin


def constants_of(rate_hz=380.0, step_s=3.5e-4, **parts):
    of_noise, of_texture = (np.random.default_rng(seed) for seed in (0, 1))
    frontend = Frontend(parts.get('electronics', Electronics()), of_noise)
    return scene_constants(parts, rate_hz, step_s, frontend, of_texture)


@given(st.floats(50.0, 5e4), st.floats(1e-5, 1e-2))
@settings(max_examples=30)
def test_a_sample_period_is_cut_into_equal_steps_no_longer_than_asked_for(rate_hz, step_s):
    constants = constants_of(rate_hz, step_s, friction=Friction(), skin=Skin(mass_kg=0.0))
    assert constants.step_s * constants.steps_per_sample * rate_hz == pytest.approx(1.0)
    assert constants.step_s <= step_s * (1.0 + 1e-6)
    assert constants.steps_per_sample == 1 or constants.step_s > 0.5 * step_s * (1.0 - 1e-6)


def test_skin_that_rings_gets_shorter_steps():
    skin = Skin(mass_kg=1e-6, damping_n_s_m=0.001, shear_stiffness_n_m=1e3)
    assert constants_of(step_s=1e-3, friction=Friction(), skin=skin).step_s < np.sqrt(1e-6 / 1e3)


def test_skin_that_rings_too_fast_is_refused():
    skin = Skin(mass_kg=1e-12, damping_n_s_m=0.0, shear_stiffness_n_m=1e6)
    with pytest.raises(ValueError, match=r'steps for a second, allowed: 2e\+06; a longer step_s'):
        constants_of(friction=Friction(), skin=skin)


def test_without_skin_and_filter_there_is_one_step_a_sample():
    assert constants_of(step_s=1e-6).steps_per_sample == 1
    assert constants_of(step_s=1e-6).decay == -1.0
    filtered = constants_of(step_s=1e-5, electronics=Electronics(bandwidth_hz=100.0))
    assert filtered.steps_per_sample == 264
    assert filtered.decay == pytest.approx(np.exp(-2 * np.pi * 100.0 * filtered.step_s))


def test_an_object_has_the_patches_between_the_taxels_too():
    plate = constants_of(friction=Friction())
    np.testing.assert_array_equal(plate.patches, np.ones(16))
    assert plate.body.mass_kg == 0.0
    held = constants_of(friction=Friction(), object=FreeObject(mass_kg=0.3, rest_patches=40.0))
    np.testing.assert_array_equal(held.patches, [*np.ones(16), 40.0])
    assert held.body.mass_kg == 0.3


def test_what_is_named_is_in_the_constants():
    contact, friction = Contact(radius_at_1n_m=4e-3), Friction(kinetic_coefficient=0.3)
    constants = constants_of(contact=contact, friction=friction, skin=Skin(mass_kg=1e-4))
    assert constants.hertz == contact.numbers()
    assert constants.friction == friction.numbers()
    assert constants.skin == Skin(mass_kg=1e-4).numbers()
