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

"""Friction: LuGre's law, and the implicit stage that solves it."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from slip_detector.scenes.friction import LIGHTEST_LOAD_N, Friction, Skin, lugre_stage, skin_stage


def decades(low, high):
    """Draw numbers evenly over their decades."""
    return st.floats(math.log10(low), math.log10(high)).map(lambda exponent: 10.0**exponent)


def either_sign(numbers):
    return st.tuples(st.sampled_from([-1.0, 1.0]), numbers).map(lambda pair: pair[0] * pair[1])


LAWS = st.builds(
    lambda kinetic, more, **other: Friction(
        kinetic_coefficient=kinetic, static_coefficient=kinetic * more, **other
    ).numbers(),
    kinetic=st.floats(0.01, 2.0),
    more=st.floats(1.0, 3.0),
    stribeck_velocity_m_s=decades(1e-4, 1.0),
    bristle_stiffness_n_m=decades(1e3, 1e9),
    bristle_damping_n_s_m=st.just(0.0) | decades(1e-4, 1e3),
    unloading_s=decades(1e-6, 1e-2),
)
LOADS_N = st.just(0.0) | decades(1e-9, 1.0)
VELOCITIES_M_S = st.just(0.0) | either_sign(decades(1e-9, 1.0))
DISPLACEMENTS_M = st.just(0.0) | either_sign(decades(1e-9, 1e-3))
STEPS_S = decades(1e-6, 1e-2)
#: Deflections in shares of the most the load holds; beyond 1 where the load has just fallen.
SHARES = st.just(0.0) | either_sign(decades(1e-6, 1e3))


def most_n(law, load_n):
    """Return the largest force at rest."""
    return law.static_coefficient * max(load_n, LIGHTEST_LOAD_N)


def steepest_n_s_m(law, load_n):
    """Return the drop from static to kinetic friction over the Stribeck velocity."""
    drop_n = max(load_n, LIGHTEST_LOAD_N) * (law.static_coefficient - law.kinetic_coefficient)
    return drop_n / law.stribeck_velocity_m_s


def level_n(w, law, load_n):
    """Return the Stribeck curve g(w)."""
    fallen = np.exp(-((w / law.stribeck_velocity_m_s) ** 2))
    drop = (law.static_coefficient - law.kinetic_coefficient) * fallen
    return max(load_n, LIGHTEST_LOAD_N) * (law.kinetic_coefficient + drop)


# The implicit stage.


def stage_balance(w, available, impedance, z, load_n, step_s, law):
    """Return what is left of the balance at a velocity, and the sum of the sizes of its terms.

    Written from the law, not from the code: z after the step solves
    z1 = z + step (w - sigma0 |w| / g z1 - (z1 - clip(z1)) / tau).
    """
    sigma0, sigma1 = law.bristle_stiffness_n_m, law.bristle_damping_n_s_m
    most_m = most_n(law, load_n) / sigma0
    rate = sigma0 * abs(w) / level_n(w, law, load_n)
    after = (z + step_s * w) / (1.0 + step_s * rate)
    if abs(after) > most_m:
        part = step_s / law.unloading_s
        limited = z + step_s * w + part * math.copysign(most_m, after)
        after = limited / (1.0 + step_s * rate + part)
    damping = sigma1 / (1.0 + sigma1 * abs(w) / level_n(w, law, load_n))
    force = sigma0 * after + damping * (w - rate * after)
    sizes = abs(available) + abs(impedance * w) + abs(sigma0 * after)
    sizes += damping * (abs(w) + rate * abs(after))
    return available - impedance * w - force, sizes, force, after


STAGES = {
    'law': LAWS,
    'load_n': LOADS_N,
    'pull': st.just(0.0) | either_sign(decades(1e-6, 1e4)),
    'impedance': decades(1e-3, 1e4),
    'w_last': VELOCITIES_M_S,
    'share': SHARES,
    'step_s': STEPS_S,
}


@settings(max_examples=400)
@given(**STAGES)
def test_the_stage_finds_the_velocity_at_which_the_forces_balance(
    law, load_n, pull, impedance, w_last, share, step_s
):
    z = share * most_n(law, load_n) / law.bristle_stiffness_n_m
    available = pull * most_n(law, load_n)
    # What is refused before a scene runs is not asked of the stage.
    assume(steepest_n_s_m(law, load_n) * math.sqrt(2.0 / math.e) < impedance)
    w, force, _, after = lugre_stage(available, impedance, w_last, z, load_n, step_s, law)
    left, sizes, wanted_force, wanted_after = stage_balance(
        w, available, impedance, z, load_n, step_s, law
    )
    sizes += abs(law.bristle_stiffness_n_m * z)
    assert abs(left) <= 1e-9 * sizes
    assert force == pytest.approx(wanted_force, rel=1e-8, abs=1e-9 * sizes)
    assert law.bristle_stiffness_n_m * after == pytest.approx(
        law.bristle_stiffness_n_m * wanted_after, rel=1e-8, abs=1e-9 * sizes
    )


@settings(max_examples=100)
@given(
    LAWS,
    LOADS_N,
    st.lists(st.tuples(VELOCITIES_M_S, decades(1e-3, 1e4)), min_size=1, max_size=20),
    STEPS_S,
)
def test_bristles_never_give_back_more_than_was_put_into_them(law, load_n, pulls, step_s):
    z = w = work_j = 0.0
    for surface_m_s, impedance in pulls:
        available = impedance * surface_m_s
        w, force, _, z = lugre_stage(available, impedance, w, z, load_n, step_s, law)
        work_j += step_s * force * w
        stored_j = 0.5 * law.bristle_stiffness_n_m * z**2
        assert work_j >= stored_j - 1e-9 * abs(work_j) - 1e-6 * stored_j


# Skin and friction together.

SKINS = st.builds(
    lambda **numbers: Skin(**numbers).numbers(),
    shear_stiffness_n_m=decades(10.0, 1e5),
    damping_n_s_m=decades(1e-3, 10.0),
)


@settings(max_examples=150)
@given(SKINS, LAWS, LOADS_N, VELOCITIES_M_S, DISPLACEMENTS_M, VELOCITIES_M_S, STEPS_S)
def test_friction_is_the_force_that_moves_the_skin(skin, law, load_n, v, x, u, step_s):
    assume(load_n > 0.0 or abs(x) >= 1e-15 or abs(u) >= 1e-15)
    assume(steepest_n_s_m(law, load_n) < skin.damping_n_s_m)
    w, force, _, _ = skin_stage(v, x, u, 0.0, 0.0, load_n, step_s, skin, law)
    # c U + k X = F with U = v - w, all at the end of the step.
    after = v - w
    terms = [
        skin.damping_n_s_m * after,
        skin.shear_stiffness_n_m * (x + step_s * after),
    ]
    sizes = skin.damping_n_s_m * abs(v)
    sizes += skin.shear_stiffness_n_m * (abs(x) + step_s * abs(v)) + sum(map(abs, terms))
    assert sum(terms) == pytest.approx(force, abs=1e-9 * sizes)


# What is refused.


@given(st.floats(0.01, 1.0), st.floats(1.01, 3.0), decades(1e-4, 1.0), st.floats(0.01, 10.0))
def test_the_steepest_fall_is_that_of_the_stribeck_curve(kinetic, more, stribeck_m_s, load_n):
    friction = Friction(
        kinetic_coefficient=kinetic,
        static_coefficient=kinetic * more,
        stribeck_velocity_m_s=stribeck_m_s,
    )
    w = np.linspace(0.0, 3.0, 3001) * stribeck_m_s
    falls = -np.gradient([level_n(velocity, friction.numbers(), load_n) for velocity in w], w)
    assert friction.steepest_fall_n_s_m(load_n) == pytest.approx(falls.max(), rel=1e-4)
