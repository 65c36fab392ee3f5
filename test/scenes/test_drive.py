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

"""What is done to the fingertip: the parts together, for one instant and for many."""

import numpy as np
import pytest

from slip_detector.scenes import Scene
from slip_detector.scenes.disturbances import TREMOR_PEAK, sines_at, sines_rate_at, tap_force_at
from slip_detector.scenes.drive import Drive, drive_at
from slip_detector.scenes.motion import force_at, load_at, plate_at
from slip_detector.scenes.rolling import rolled_at

STEPS = [
    {'duration_s': 0.1},
    {'duration_s': 0.1, 'force_n': 0.3},
    {'duration_s': 0.3, 'velocity_m_s': 6.7e-3},
    {'duration_s': 0.1, 'force_n': 0.0},
    {'duration_s': 0.2},
]
TREMOR = {'force_rms_n': 0.05, 'motion_rms_m': 5e-5}
DISTURBED = {
    'steps': STEPS,
    'contact': {'centre_m': [1e-3, -2e-3]},
    'tremor': TREMOR,
    'taps': {'times_s': [0.15, 0.3, 0.72], 'peak_force_n': -0.5},
    'rolling': {'start_s': 0.15, 'duration_s': 0.1, 'hold_s': 0.05, 'distance_m': [2e-3, 1e-3]},
}
SHAKEN = {
    'steps': [
        {'duration_s': 0.2, 'force_n': 2.5},
        {'duration_s': 0.1, 'carried': 1.0},
        {'duration_s': 0.5, 'pull_n': 1.0},
    ],
    'friction': {},
    'object': {'mass_kg': 0.3},
    'tremor': TREMOR,
}
PLAIN = {'steps': STEPS}


def fresh(description):
    return Scene(description, np.random.default_rng(0))


def instants_s(n=400):
    return np.sort(np.random.default_rng(1).uniform(0.0, 0.8, n))


@pytest.mark.parametrize('description', [PLAIN, DISTURBED, SHAKEN])
def test_one_instant_and_many_give_the_same_bits(description):
    numbers, t = fresh(description).drive_numbers, instants_s()
    whole = drive_at(t, t, numbers)
    one_by_one = [drive_at(time_s, time_s, numbers) for time_s in t.tolist()]
    for i, name in enumerate(Drive._fields):
        np.testing.assert_array_equal(whole[i], [one[i] for one in one_by_one], err_msg=name)


def test_taps_tremor_and_rolling_come_on_top_of_what_the_steps_ask_for():
    numbers, t = fresh(DISTURBED).drive_numbers, instants_s()
    drive = drive_at(t, t, numbers)
    pressed_n = force_at(t, t, numbers.force) + tap_force_at(t, t, numbers.taps)
    # A hand that does not touch does not press.
    share = np.minimum(pressed_n / (TREMOR_PEAK * TREMOR['force_rms_n']), 1.0)
    pressed_n += share * sines_at(t, numbers.force_sines)
    np.testing.assert_allclose(drive.force_n, np.maximum(pressed_n, 0.0), atol=1e-15)
    assert pressed_n.min() < 0.0 < drive.force_n.max()
    x_m, y_m = rolled_at(t, numbers.rolling)
    np.testing.assert_allclose(drive.centre_x_m, 1e-3 + x_m, atol=1e-18)
    np.testing.assert_allclose(drive.centre_y_m, -2e-3 + y_m, atol=1e-18)
    velocity_m_s, position_m = plate_at(t, t, numbers.plate)
    velocity_m_s += sines_rate_at(t, numbers.motion_sines)
    np.testing.assert_allclose(drive.velocity_m_s, velocity_m_s, atol=1e-18)
    np.testing.assert_allclose(
        drive.position_m, position_m + sines_at(t, numbers.motion_sines), atol=1e-18
    )
    np.testing.assert_array_equal(drive.load_n, 0.0)


def test_an_object_pulls_against_a_hand_that_trembles():
    numbers, t = fresh(SHAKEN).drive_numbers, instants_s()
    drive = drive_at(t, t, numbers)
    h = 1e-4
    before, here, after = (sines_at(t + k * h, numbers.motion_sines) for k in (-1, 0, 1))
    acceleration_m_s2 = (before - 2.0 * here + after) / h**2
    inertia_n = drive.load_n - load_at(t, numbers.load)
    np.testing.assert_allclose(inertia_n, -0.3 * acceleration_m_s2, atol=1e-5)
    assert np.abs(inertia_n).max() > 1e-2
    np.testing.assert_array_equal(drive.velocity_m_s, 0.0)
    np.testing.assert_array_equal(drive.position_m, 0.0)


def test_the_corners_of_all_parts_are_known():
    speeds_up_s = 6.7e-3 / 0.46
    wanted_s = [0.1, 0.2, 0.5, 0.6, 0.2 + speeds_up_s, 0.5 + speeds_up_s]
    wanted_s += [0.15, 0.16, 0.3, 0.31, 0.72, 0.73]  # taps
    wanted_s += [0.15, 0.25, 0.3, 0.4]  # rolling
    found_s = fresh(DISTURBED).corners_s()
    assert np.all(np.diff(found_s) > 0.0)
    for corner_s in wanted_s:
        assert np.abs(found_s - corner_s).min() < 1e-12
    for corner_s in found_s:
        assert np.abs(corner_s - wanted_s).min() < 1e-12
    np.testing.assert_allclose(fresh(SHAKEN).corners_s(), [0.2, 0.3])


def test_at_a_corner_the_side_says_which_piece_is_meant():
    numbers = fresh(PLAIN).drive_numbers
    # The plate starts at 0.2 s; what the piece before would give goes on at rest.
    assert drive_at(0.205, 0.19, numbers).velocity_m_s == 0.0
    assert drive_at(0.205, 0.21, numbers).velocity_m_s == pytest.approx(0.46 * 0.005)
