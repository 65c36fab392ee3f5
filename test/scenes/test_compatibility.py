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

import re

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from slip_detector.scenes.disturbances import Taps, Tremor
from slip_detector.scenes.electronics import Electronics
from slip_detector.scenes.free_object import FreeObject
from slip_detector.scenes.friction import Friction
from slip_detector.scenes.motion import Step
from slip_detector.scenes.parts import check_grip, check_parts
from slip_detector.scenes.texture import Texture
from support.scene_cases import RIDGES, built

OBJECT = {'object': FreeObject(), 'friction': Friction()}


@pytest.mark.parametrize(
    ('parts', 'step', 'said'),
    [
        ({'object': FreeObject()}, Step(), 'object: falls without friction, allowed: with the'),
        (OBJECT, Step(velocity_m_s=-0.01), 'steps: velocity_m_s is not 0, allowed: 0 with an ob'),
        ({**OBJECT, 'texture': Texture()}, Step(), 'electronics: bandwidth_hz is 0, allowed: abo'),
        ({}, Step(carried=0.0), 'steps: carried and pull_n are for an object, allowed: with that'),
        ({}, Step(pull_n=-1.0), 'steps: carried and pull_n are for an object, allowed: with that'),
    ],
)
def test_parts_that_do_not_go_together_are_named(parts, step, said):
    with pytest.raises(ValueError, match=f'^{re.escape(said)}'):
        check_parts(parts, [Step(), step], 380.0)


def test_parts_that_go_together_pass():
    filtered = {**OBJECT, 'texture': Texture(), 'electronics': Electronics(bandwidth_hz=100.0)}
    check_parts(filtered, [Step(carried=1.0, pull_n=0.1)], 380.0)
    check_parts({}, [Step(velocity_m_s=1.0)], 380.0)


@given(st.floats(1e-3, 1.0), st.floats(1e-4, 1e-2), st.lists(st.just(0.1), max_size=3))
def test_ridges_may_pass_at_up_to_half_the_sample_rate(velocity_m_s, period_m, harmonics):
    texture = Texture(
        spatial_period_m=period_m, ridge_height_m=1e-5, harmonics=harmonics, indentation_m=1e-3
    )
    highest_hz = velocity_m_s * (1 + len(harmonics)) / period_m
    steps = [Step(velocity_m_s=-velocity_m_s)]
    assume(highest_hz > 1.0)
    check_parts({'texture': texture}, steps, 2.001 * highest_hz)
    with pytest.raises(ValueError, match=r'^texture: ridges pass at up to'):
        check_parts({'texture': texture}, steps, 1.999 * highest_hz)


@pytest.mark.parametrize('extra', [{}, {'electronics': {'bandwidth_hz': 1e3}}])
def test_ridges_too_fast_for_the_samples_need_a_bandwidth(extra):
    texture = {**RIDGES, 'spatial_period_m': 400e-6, 'harmonics': [0.1, 0.1]}
    # 100 Hz, of which the third harmonic passes at 300.
    steps = [{'duration_s': 1.0, 'velocity_m_s': 40e-3}]
    description = {'steps': steps, 'texture': texture, 'sample_rate_hz': 599.0, **extra}
    if extra:
        built(description)
        return
    with pytest.raises(
        ValueError,
        match=r'^texture: ridges pass at up to 300 Hz, which aliases at a sample rate of 599 Hz',
    ):
        built(description)
    built({**description, 'sample_rate_hz': 601.0})


def test_the_skin_must_not_chatter_under_the_largest_force_that_may_come():
    # Chatters from some force on: found by halving.
    friction = Friction(kinetic_coefficient=0.3, static_coefficient=0.6)
    parts = {'friction': friction}
    low_n, high_n = 1e-3, 1000.0
    for _ in range(60):
        middle_n = 0.5 * (low_n + high_n)
        try:
            check_grip(parts, middle_n)
            low_n = middle_n
        except ValueError:
            high_n = middle_n
    with pytest.raises(ValueError, match=r'^friction: .* chatter'):
        check_grip(parts, 1.01 * high_n)
    # What the ringing, taps and tremor may add counts too.
    steps = [Step(force_n=0.5 * low_n)]
    check_parts(parts, steps, 380.0)
    for more in (
        {'taps': Taps(times_s=[1.0], peak_force_n=0.6 * low_n)},
        {'tremor': Tremor(force_rms_n=0.2 * low_n)},
    ):
        with pytest.raises(ValueError, match='chatter'):
            check_parts({**parts, **more}, steps, 380.0)
    with pytest.raises(ValueError, match='chatter'):
        check_parts(parts, [Step(force_n=0.9 * low_n)], 380.0)
    check_parts({**parts, 'taps': Taps(times_s=[1.0], peak_force_n=-low_n)}, steps, 380.0)


def test_a_grip_is_named_as_what_it_is():
    parts = {'friction': Friction(kinetic_coefficient=0.1, static_coefficient=1.0)}
    with pytest.raises(ValueError, match=r'^a grip of 70 N: falls with velocity'):
        check_grip(parts, 140.0, 'a grip of 70 N')
