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

"""Motion: the force rings like a damped mass, the plate moves as the steps say."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from slip_detector.scenes.motion import (
    Motion,
    Step,
    force_at,
    force_numbers,
    held_force,
    load_corners,
    plate_at,
    plate_pieces,
)

FORCES_N = st.floats(1e-3, 5.0)
FORCE_STEPS = st.lists(
    st.builds(
        Step, duration_s=st.floats(0.01, 0.3), force_n=st.sampled_from([-1.0, 0.0]) | FORCES_N
    ),
    min_size=1,
    max_size=5,
)
MOTIONS = st.builds(
    Motion,
    ringing_hz=st.floats(1.0, 60.0),
    ringing_damping=st.floats(0.01, 3.0) | st.sampled_from([1.0 - 1e-7, 1.0, 1.0 + 1e-7]),
)


def integrated_n(motion, corners_s, commands_n, at_s):
    """Solve F'' + 2 d w F' + w^2 F = w^2 command from corner to corner, with a matrix for each."""
    omega = 2.0 * np.pi * motion.ringing_hz
    # How force, its rate, command and its slope change.
    rates = np.zeros((4, 4))
    rates[0, 1] = rates[2, 3] = 1.0
    rates[1] = -(omega**2), -2.0 * motion.ringing_damping * omega, omega**2, 0.0
    state, out = np.zeros(4), np.zeros(len(at_s))
    ends_s = [*corners_s[1:], max(at_s[-1], corners_s[-1]) + 1.0]
    ends_n = [*commands_n[1:], commands_n[-1]]
    for start_s, end_s, start_n, end_n in zip(corners_s, ends_s, commands_n, ends_n, strict=True):
        if start_s == end_s:  # The command jumps.
            continue
        state[2:] = start_n, (end_n - start_n) / (end_s - start_s)
        inside = (at_s >= start_s) & (at_s < end_s)
        out[inside] = [(expm(rates * (t - start_s)) @ state)[0] for t in at_s[inside]]
        state = expm(rates * (end_s - start_s)) @ state
    return out


def check_force(force, motion, corners_s, commands_n, at_s):
    """Compare the force with the solution of the equation."""
    wanted_n = np.maximum(integrated_n(motion, corners_s, commands_n, at_s), 0.0)
    # Nearest to a damping ratio of 1 the closed form loses digits: 5 N / 1e-6 times 1e-16.
    np.testing.assert_allclose(np.maximum(force_at(at_s, force), 0.0), wanted_n, atol=2e-5)


# The normal force.


@settings(max_examples=25)
@given(MOTIONS, FORCE_STEPS)
def test_the_force_follows_the_command_as_a_damped_mass_does(motion, steps):
    corners_s, commands_n = [0.0], [0.0]
    for step in steps:
        corners_s.append(corners_s[-1] + step.duration_s)
        commands_n.append(commands_n[-1] if step.force_n < 0.0 else step.force_n)
    at_s = np.linspace(0.0, corners_s[-1] + 0.2, 50)
    check_force(force_numbers(motion, steps), motion, corners_s, commands_n, at_s)


# A grip from outside.


@settings(max_examples=20)
@given(MOTIONS, st.lists(st.tuples(st.floats(0.0, 0.2), st.just(0.0) | FORCES_N), min_size=1))
def test_any_number_of_grips_gives_what_the_damped_mass_does(motion, holds):
    force = force_numbers(motion, [Step(10.0, 0.0)])
    time_s, last_n = 0.0, 0.0
    corners_s, commands_n = [0.0], [0.0]
    for after_s, grip_n in holds:
        time_s += after_s
        force = held_force(force, time_s, grip_n)
        corners_s += [time_s, time_s]
        commands_n += [last_n, grip_n]
        last_n = grip_n
    # What it was before the last but one grip need not be known any more.
    at_s = np.linspace(time_s, time_s + 1.0, 50)
    check_force(force, motion, corners_s, commands_n, at_s)


# The platform.

VELOCITY_STEPS = st.lists(
    st.builds(Step, duration_s=st.floats(0.1, 0.5), velocity_m_s=st.floats(-0.1, 0.1)),
    min_size=1,
    max_size=5,
)


@given(VELOCITY_STEPS, st.floats(2.0, 100.0))
def test_the_plate_reaches_each_velocity_at_its_acceleration(steps, acceleration_m_s2):
    plate = plate_pieces(Motion(acceleration_m_s2=acceleration_m_s2), steps)
    ends_s = np.cumsum([step.duration_s for step in steps])
    wanted = [step.velocity_m_s for step in steps]
    reached_m_s, _ = plate_at(ends_s - 1e-9, plate)
    np.testing.assert_allclose(reached_m_s, wanted, atol=1e-6)
    # Between these times the velocity is linear.
    at_s = np.unique([*np.linspace(0.0, ends_s[-1], 1000), *plate[0]])
    velocity_m_s, position_m = plate_at(at_s, plate)
    steps_s = np.diff(at_s)
    assert np.all(np.abs(np.diff(velocity_m_s)) <= acceleration_m_s2 * steps_s + 1e-9)
    ways_m = steps_s * (velocity_m_s[1:] + velocity_m_s[:-1]) / 2.0
    np.testing.assert_allclose(position_m[1:], np.cumsum(ways_m), rtol=0, atol=1e-11)
    assert np.abs(plate[2]).max() == pytest.approx(np.abs(wanted).max())


# The load on an object.


def test_the_load_ramps_from_step_to_step():
    steps = [Step(1.0), Step(0.5, carried=1.0), Step(1.0), Step(0.5, pull_n=3.0), Step(0.5)]
    load = load_corners(2.0, steps)
    at_s = np.array([0.0, 1.0, 1.25, 1.5, 2.5, 2.75, 3.0, 3.25, 3.5, 99.0])
    wanted_n = [0.0, 0.0, 1.0, 2.0, 2.0, 3.5, 5.0, 3.5, 2.0, 2.0]
    np.testing.assert_allclose(np.interp(at_s, *load), wanted_n, atol=1e-12)
