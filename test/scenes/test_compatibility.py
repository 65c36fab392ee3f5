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

"""Which parts go together, and what is said of those that do not."""

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from slip_detector.scenes.disturbances import Taps, Tremor
from slip_detector.scenes.friction import Friction, Skin
from slip_detector.scenes.motion import Step
from slip_detector.scenes.parts import ALWAYS, PARTS, check_grip, check_parts
from slip_detector.scenes.surface import Contact, Texture


def whole(parts):
    """Return some parts and those that every scene has."""
    return {**{name: PARTS[name]() for name in ALWAYS}, **parts}


def checked(parts, steps, rate_hz):
    check_parts(whole(parts), steps, rate_hz)


@given(st.floats(1e-3, 1.0), st.floats(1e-4, 1e-2), st.lists(st.just(0.1), max_size=3))
def test_ridges_may_pass_at_up_to_half_the_sample_rate(velocity_m_s, period_m, harmonics):
    texture = Texture(
        spatial_period_m=period_m, ridge_height_m=1e-5, harmonics=harmonics, indentation_m=1e-3
    )
    highest_hz = velocity_m_s * (1 + len(harmonics)) / period_m
    steps = [Step(velocity_m_s=-velocity_m_s)]
    assume(highest_hz > 1.0)
    checked({'texture': texture}, steps, 2.001 * highest_hz)
    with pytest.raises(ValueError, match=r'^texture: ridges pass at up to'):
        checked({'texture': texture}, steps, 1.999 * highest_hz)


def test_the_skin_must_not_chatter_under_the_largest_force_that_may_come():
    friction = Friction(kinetic_coefficient=0.3, static_coefficient=0.6)
    parts = {'friction': friction}
    # The largest load of a taxel grows with the cube root of the force.
    of_1_n = friction.steepest_fall_n_s_m(Contact().largest_load_n(1.0))
    most_n = (Skin().damping_n_s_m / of_1_n) ** 3
    check_grip(whole(parts), 0.999 * most_n)
    with pytest.raises(ValueError, match=r'^friction: .* chatter'):
        check_grip(whole(parts), 1.001 * most_n)
    # What the ringing, taps and tremor may add counts too.
    steps = [Step(force_n=0.5 * most_n)]
    checked(parts, steps, 380.0)
    for more, share in (
        ({}, 0.9),
        ({'taps': Taps(times_s=[1.0], peak_force_n=0.6 * most_n)}, 0.5),
        ({'tremor': Tremor(force_rms_n=0.2 * most_n)}, 0.5),
    ):
        with pytest.raises(ValueError, match='chatter'):
            checked({**parts, **more}, [Step(force_n=share * most_n)], 380.0)
    checked({**parts, 'taps': Taps(times_s=[1.0], peak_force_n=-most_n)}, steps, 380.0)
