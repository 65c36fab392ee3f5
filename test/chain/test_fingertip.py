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

"""The 16-channel layout: the groups of Table 1 and where the taxels sit."""

import itertools

import numpy as np

from slip_detector.chain.fingertip import (
    SENSOR_PITCH_M,
    UNIT_RADIUS_M,
    taxel_positions,
)
from slip_detector.parameters.detector import PAPER_CHANNELS, PAPER_GROUPS


def sensor_of(channel):
    return (channel - 1) // 4


def offsets():
    """Return each taxel's place relative to its sensor's centre, the mean of its four."""
    sensors = taxel_positions().reshape(4, 4, 2)
    return (sensors - sensors.mean(axis=1, keepdims=True)).reshape(PAPER_CHANNELS, 2)


def as_set(points):
    return {tuple(np.round(point * 1e9).astype(int)) for point in points}


def test_the_groups_are_those_of_table_1():
    assert PAPER_GROUPS == {
        'TP': (14, 16, 11, 9),
        'TD': (1, 3, 8, 6),
        'LR': (5, 7, 12, 10),
        'LU': (2, 4, 15, 13),
    }


def test_the_groups_share_out_all_channels_four_each():
    assert [len(members) for members in PAPER_GROUPS.values()] == [4, 4, 4, 4]
    assert sorted(itertools.chain(*PAPER_GROUPS.values())) == list(range(1, PAPER_CHANNELS + 1))


def test_every_group_holds_two_units_of_each_of_two_neighbouring_sensors():
    centres = taxel_positions().reshape(4, 4, 2).mean(axis=1)
    for name, members in PAPER_GROUPS.items():
        sensors = sorted({sensor_of(channel) for channel in members})
        assert len(sensors) == 2, name
        assert [sum(sensor_of(c) == s for c in members) for s in sensors] == [2, 2], name
        distance = np.linalg.norm(centres[sensors[0]] - centres[sensors[1]])
        assert np.isclose(distance, SENSOR_PITCH_M), name


def test_the_units_of_a_group_have_the_same_orientation():
    for name, members in PAPER_GROUPS.items():
        across, along = np.abs(offsets()[np.array(members) - 1]).T
        if name.startswith('T'):
            assert np.allclose(across, UNIT_RADIUS_M), name
            assert np.allclose(along, 0, atol=1e-12), name
        else:
            assert np.allclose(across, 0, atol=1e-12), name
            assert np.allclose(along, UNIT_RADIUS_M), name


def test_the_groups_sit_where_their_names_say():
    middle = {
        name: taxel_positions()[np.array(members) - 1].mean(axis=0)
        for name, members in PAPER_GROUPS.items()
    }
    half = SENSOR_PITCH_M / 2
    # Distal is towards the tip (y), radial along x.
    assert np.allclose(middle['TD'], [0, half])
    assert np.allclose(middle['TP'], [0, -half])
    assert np.allclose(middle['LR'], [half, 0])
    assert np.allclose(middle['LU'], [-half, 0])


def test_every_sensor_is_a_cross_of_two_arms():
    for sensor in offsets().reshape(4, 4, 2):
        r = UNIT_RADIUS_M
        assert as_set(sensor) == as_set(np.array([(-r, 0), (r, 0), (0, -r), (0, r)]))


def test_the_sensors_are_a_square_array_of_their_pitch():
    half = SENSOR_PITCH_M / 2
    centres = taxel_positions().reshape(4, 4, 2).mean(axis=1)
    assert as_set(centres) == as_set(np.array(list(itertools.product((-half, half), repeat=2))))


def test_the_layout_is_symmetric_about_the_centre():
    positions = taxel_positions()
    assert positions.shape == (PAPER_CHANNELS, 2)
    places = as_set(positions)
    assert len(places) == PAPER_CHANNELS
    assert as_set(-positions) == places
    assert as_set(positions * [-1, 1]) == places
    assert as_set(positions * [1, -1]) == places


def test_the_taxels_cover_a_fingertip():
    positions = taxel_positions()
    gaps = [np.linalg.norm(a - b) for a, b in itertools.combinations(positions, 2)]
    assert min(gaps) > 0.5e-3
    assert 2e-3 < np.ptp(positions[:, 0]) < 5e-3
    assert 2e-3 < np.ptp(positions[:, 1]) < 5e-3


def test_the_caller_may_change_its_positions():
    taxel_positions()[:] = 0
    assert len(as_set(taxel_positions())) == PAPER_CHANNELS
