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

"""The 16-channel layout: where the taxels of the groups of Table 1 are."""

import itertools

import numpy as np

from slip_detector.chain.fingertip import SENSOR_PITCH_M, UNIT_RADIUS_M, taxel_positions
from slip_detector.parameters.detector import PAPER_GROUPS

HALF_M = SENSOR_PITCH_M / 2


def as_set(points):
    return {tuple(np.round(np.multiply(point, 1e9)).astype(int)) for point in points}


def test_four_sensors_in_a_square_are_crosses_of_four_units_each():
    sensors = taxel_positions().reshape(4, 4, 2)
    centres = sensors.mean(axis=1)
    assert as_set(centres) == as_set(itertools.product((-HALF_M, HALF_M), repeat=2))
    r = UNIT_RADIUS_M
    for units, centre in zip(sensors, centres, strict=True):
        assert as_set(units - centre) == as_set([(-r, 0), (r, 0), (0, -r), (0, r)])


def test_each_group_has_equal_units_of_two_neighbouring_sensors_where_its_name_says():
    # Distal is towards the tip (y), radial along x.
    middles = {'TD': (0, HALF_M), 'TP': (0, -HALF_M), 'LR': (HALF_M, 0), 'LU': (-HALF_M, 0)}
    offsets = taxel_positions().reshape(4, 4, 2)
    offsets = (offsets - offsets.mean(axis=1, keepdims=True)).reshape(16, 2)
    for name, group in PAPER_GROUPS.items():
        members = np.array(group) - 1
        np.testing.assert_allclose(
            taxel_positions()[members].mean(axis=0), middles[name], atol=1e-12
        )
        assert np.bincount(members // 4, minlength=4).tolist().count(2) == 2, name
        along = 0 if name.startswith('T') else 1
        np.testing.assert_allclose(np.abs(offsets[members, along]), UNIT_RADIUS_M)
