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

"""Where the channels of a finger are drawn."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.chain.fingertip import taxel_positions
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.taxels import GRID_PITCH_M, drawn_positions, least_distance_m

CONFIG = Path(__file__).resolve().parents[2] / 'config'


def with_positions(positions):
    positions = np.asarray(positions, np.float64)
    return DetectorConfig(channels=len(positions), taxel_positions_m=positions.ravel())


@given(st.integers(1, 400))
def test_without_positions_the_channels_stand_in_rows_of_a_grid_around_the_middle(channels):
    x, y, z = drawn_positions(DetectorConfig(channels=channels)).T / GRID_PITCH_M
    assert not z.any()
    rows = [list(row) for _, row in itertools.groupby(range(channels), key=lambda c: y[c])]
    assert all(len(row) == len(rows[0]) for row in rows[:-1])
    assert len(rows[0]) - len(rows) in (0, 1)
    for row in rows:
        assert np.allclose(np.diff(x[row]), 1.0)
        assert x[row[0]] == x.min() == -x.max()
    assert np.allclose(np.diff([y[row[0]] for row in rows]), -1.0)
    assert y.max() == -y.min()


@settings(max_examples=50)
@given(
    st.lists(
        st.tuples(st.integers(-3, 3), st.integers(-3, 3), st.integers(0, 1)),
        min_size=1,
        max_size=30,
    )
)
def test_channels_that_share_a_place_are_drawn_apart_and_closer_to_it_than_to_any_other(cells):
    places = 0.004 * np.array(cells, np.float64)
    drawn = drawn_positions(with_positions(places))
    assert least_distance_m(drawn) > 1e-5
    for channel, place in enumerate(places):
        distances = np.linalg.norm(places - drawn[channel], axis=1)
        nearest = places[np.isclose(distances, distances.min(), atol=1e-12)]
        assert np.allclose(nearest, place)
        same = (places == place).all(axis=1)
        assert np.allclose(drawn[same].mean(axis=0), place, atol=1e-12)


def test_the_axes_of_a_taxel_stand_around_it_from_the_left_clockwise():
    drawn = drawn_positions(with_positions([[0, 0, 0]] * 3 + [[0.004, 0, 0]] * 3))
    x, y = 1e3 * drawn[:3, :2].T
    assert np.allclose(x, [-1.0, 0.5, 0.5])
    assert np.allclose(y, [0.0, np.sqrt(0.75), -np.sqrt(0.75)])


def test_a_single_channel_is_drawn_in_the_middle():
    for config in (DetectorConfig(channels=1), with_positions([[0, 0, 0]])):
        assert np.array_equal(drawn_positions(config), [[0, 0, 0]])
        assert least_distance_m(drawn_positions(config)) == GRID_PITCH_M


def test_positions_that_differ_are_drawn_where_they_are_and_may_be_changed_by_the_caller():
    positions = np.random.default_rng(1).uniform(-0.02, 0.02, (40, 3))
    config = with_positions(positions)
    drawn_positions(config)[:] = 0
    assert np.array_equal(drawn_positions(config), positions)


@pytest.mark.parametrize('name', ['slip_detector', 'onset', 'sure', 'grasp'])
def test_the_configurations_of_the_papers_fingertip_have_its_positions(name):
    config = DetectorConfig.from_yaml(CONFIG / f'{name}.yaml')
    positions = np.column_stack([taxel_positions(), np.zeros(config.channels)])
    assert np.allclose(drawn_positions(config), positions, atol=1e-12)


def test_the_configuration_of_uskin_has_two_fingers_of_four_rows_of_taxels_with_three_axes():
    config = DetectorConfig.from_yaml(CONFIG / 'xela_uskin.yaml')
    fingers = np.reshape(config.taxel_positions_m, (2, 4, 4, 3, 3))  # finger, row, column, axis
    assert (fingers == fingers[:, :, :, :1]).all(), 'the axes of a taxel are at one place'
    assert not fingers[..., 2].any()
    # The pitch of the maker's model, to the tenth of a millimetre that the file has.
    places = fingers[:, :, :, 0, :2]
    assert np.allclose(np.diff(places[..., 0], axis=2), 4.667e-3, atol=1e-4)
    assert np.allclose(np.diff(places[..., 1], axis=1), -4.667e-3, atol=1e-4)
    assert np.allclose(places[1] - places[0], [0.021, 0.0])
    assert np.allclose(places.mean(axis=(0, 1, 2)), 0.0, atol=1e-12)
    assert len(np.unique(drawn_positions(config), axis=0)) == 96
