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

"""The taxels of fingers as markers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from visualization_msgs.msg import Marker

from slip_detector.nodes.view_topics import LIFETIME_S, finger_markers
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.detectors import Finger, drawn_positions, least_distance_m

FOUR = DetectorConfig(channels=4, groups={'left': (1, 2), 'right': (3, 4)}, vote=1)


def finger_with(levels, config=FOUR, *, slip=False, groups=(False, False)):
    """Return a finger whose channels have levels, in thresholds; those above one are ON."""
    finger = Finger('/index/slip_detector', config)
    levels = np.asarray(levels, np.float64)
    on = levels > 1
    finger.track.add_levels(
        np.array([10**9]), levels[np.newaxis] * config.threshold, on[np.newaxis], np.array([slip])
    )
    finger.slip, finger.valid = slip, not np.isnan(levels).all()
    finger.groups = np.array(groups)
    finger.sample_s = finger.heard_s
    return finger


def cubes(finger):
    """Return height and colour of the cube of each channel, the height in units of a distance."""
    _, marker = finger_markers(finger)
    positions = drawn_positions(finger.config)
    places = np.array([(place.x, place.y, place.z) for place in marker.points]) - positions
    assert not places[:, :2].any()
    colors = [(each.r, each.g, each.b, each.a) for each in marker.colors]
    return places[:, 2] / least_distance_m(positions), colors


def text_of(finger):
    return finger_markers(finger)[0].text


def test_each_channel_stands_at_its_place_in_the_frame_of_the_samples():
    config = DetectorConfig(channels=3, taxel_positions_m=(0, 0, 0, 4e-3, 0, 1e-3, 0, 5e-3, 0))
    finger = finger_with([0.0, 0.0, 0.0], config)
    finger.frame_id = 'index_tip'
    text, marker = finger_markers(finger)
    assert (text.type, marker.type) == (Marker.TEXT_VIEW_FACING, Marker.CUBE_LIST)
    assert not cubes(finger)[0].any()
    assert 0 < marker.scale.x == marker.scale.y == marker.scale.z < 4e-3
    for each in (text, marker):
        assert (each.ns, each.action, each.header.frame_id) == ('index', Marker.ADD, 'index_tip')
        # No stamp: at the place where the frame is now, wherever the finger moves.
        assert each.header.stamp.sec == each.header.stamp.nanosec == 0
        assert each.frame_locked
        assert each.lifetime.sec == LIFETIME_S


@given(st.lists(st.floats(0, 1e6), min_size=4, max_size=4))
def test_a_higher_level_is_a_higher_cube(levels):
    heights, colors = cubes(finger_with(levels))
    assert (np.diff(heights[np.argsort(levels)]) >= -1e-9).all()
    assert heights.min() >= 0.0
    assert heights.max() <= 1.5 + 1e-9
    assert {opacity for *_, opacity in colors} == {1.0}


def test_what_is_on_not_valid_or_disabled_has_a_colour_of_its_own():
    config = DetectorConfig(channels=6, disabled_channels=(6,), groups={'all': (1, 2, 3, 4, 5)})
    levels = [0.0, 1.0, 1.01, 40.0, np.nan, np.nan]
    heights, colors = cubes(finger_with(levels, config, groups=(False,)))
    quiet, near, on, far, not_valid, disabled = colors
    assert on == far
    assert len({quiet, near, on, not_valid, disabled}) == 5
    assert disabled[3] < 1.0
    assert heights == pytest.approx([0.0, 1.0, 1.0, 1.5, 0.0, 0.0], abs=0.01)


def test_the_text_says_slip_and_which_groups():
    finger = finger_with([2, 0, 0, 0], slip=True, groups=(True, False))
    assert text_of(finger) == 'index: SLIP left'
    assert text_of(finger_with([2, 0, 0, 0], slip=True)) == 'index: SLIP'
    assert text_of(finger_with([0, 0, 0, 0])) == 'index: rest'
    assert finger_markers(finger)[0].color.r == pytest.approx(cubes(finger)[1][0][0])


@pytest.mark.parametrize(
    ('time', 'words'), [('sample_s', 'no input'), ('heard_s', 'detector silent')]
)
def test_when_nothing_comes_no_channel_looks_as_if_it_were_measured(time, words):
    finger = finger_with([3, 0, 0, 0], slip=True)
    setattr(finger, time, getattr(finger, time) - 60.0)
    text, _ = finger_markers(finger)
    assert text.text == f'index: {words}'
    assert text.color == finger_markers(finger_with([0] * 4))[0].color
    heights, colors = cubes(finger)
    assert not heights.any()
    assert set(colors) == set(cubes(finger_with([np.nan] * 4))[1])
