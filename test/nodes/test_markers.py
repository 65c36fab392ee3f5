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
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker, MarkerArray

from slip_detector.nodes.markers import LIFETIME_S, finger_markers
from slip_detector.nodes.messages import event_qos
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.detectors import Finger, drawn_positions, least_distance_m
from support.harness import patient_qos

FOUR = DetectorConfig(channels=4, groups={'left': (1, 2), 'right': (3, 4)}, vote=1)


def finger_with(levels, config=FOUR, *, on=None, slip=False, groups=(False, False)):
    """Return a finger whose channels have levels, in thresholds; those above one are ON."""
    finger = Finger('/index/slip_detector', config)
    levels = np.asarray(levels, np.float64)
    on = levels > 1 if on is None else on
    finger.track.add_levels(
        np.array([10**9]), levels[np.newaxis] * config.threshold, on[np.newaxis], np.array([slip])
    )
    finger.slip, finger.valid = slip, not np.isnan(levels).all()
    finger.groups = np.array(groups)
    finger.sample_s = finger.heard_s
    return finger


def bars(finger):
    """Return the markers of the channels, without the text before them."""
    text, *markers = finger_markers(finger)
    assert text.type == Marker.TEXT_VIEW_FACING
    return markers


def text_of(finger):
    return finger_markers(finger)[0].text


def rgb(marker):
    return marker.color.r, marker.color.g, marker.color.b


def test_each_channel_stands_at_its_place_in_the_frame_of_the_samples():
    config = DetectorConfig(channels=3, taxel_positions_m=(0, 0, 0, 4e-3, 0, 1e-3, 0, 5e-3, 0))
    finger = finger_with([0.1, 0.2, 0.3], config)
    finger.frame_id = 'index_tip'
    for channel, (marker, place) in enumerate(
        zip(bars(finger), drawn_positions(config), strict=True), start=1
    ):
        assert (marker.ns, marker.id, marker.action) == ('index', channel, Marker.ADD)
        assert marker.header.frame_id == 'index_tip'
        assert (marker.pose.position.x, marker.pose.position.y) == (place[0], place[1])
        bottom = marker.pose.position.z - marker.scale.z / 2
        assert bottom == pytest.approx(place[2])
        # No stamp: at the place where the frame is now, wherever the finger moves.
        assert marker.header.stamp.sec == marker.header.stamp.nanosec == 0
        assert marker.frame_locked
        assert marker.lifetime.sec == LIFETIME_S
        assert marker.pose.orientation.w == 1.0


@given(st.lists(st.floats(0, 1e6), min_size=4, max_size=4))
def test_a_higher_level_is_a_higher_bar_and_none_reaches_its_neighbour(levels):
    markers = bars(finger_with(levels))
    unit_m = least_distance_m(drawn_positions(FOUR))
    order = np.argsort(levels)
    heights = np.array([marker.scale.z for marker in markers])[order]
    assert (np.diff(heights) >= 0).all()
    assert 0 < heights.min() <= heights.max() < 2 * unit_m
    for marker in markers:
        assert marker.type == Marker.CYLINDER
        assert 0 < marker.scale.x == marker.scale.y < unit_m
        assert marker.color.a == 1.0


def test_a_channel_that_is_on_is_wider_and_has_a_colour_of_its_own():
    quiet, near, on, far = bars(finger_with([0.0, 1.0, 1.01, 40.0]))
    assert quiet.scale.x == near.scale.x < on.scale.x == far.scale.x
    assert rgb(quiet) != rgb(near) != rgb(on) == rgb(far)


def test_a_channel_that_is_not_valid_and_one_that_is_disabled_have_shapes_of_their_own():
    config = DetectorConfig(channels=4, disabled_channels=(4,), groups={'all': (1, 2, 3)})
    finger = finger_with([0.5, np.nan, 0.5, np.nan], config, groups=(False,))
    good, bad, _, disabled = bars(finger)
    assert (good.type, bad.type) == (Marker.CYLINDER, Marker.CUBE)
    assert (disabled.type, disabled.scale.z < good.scale.z) == (Marker.CYLINDER, True)
    assert disabled.color.a < 1.0
    assert len({rgb(marker) for marker in (good, bad, disabled)}) == 3


def test_the_text_says_slip_and_which_groups():
    finger = finger_with([2, 0, 0, 0], slip=True, groups=(True, False))
    assert text_of(finger) == 'index: SLIP left'
    assert text_of(finger_with([2, 0, 0, 0], slip=True)) == 'index: SLIP'
    assert text_of(finger_with([0, 0, 0, 0])) == 'index: rest'
    assert rgb(finger_markers(finger)[0]) == rgb(bars(finger)[0])


@pytest.mark.parametrize('words', ['no input', 'detector silent'])
def test_when_nothing_comes_no_channel_looks_as_if_it_were_measured(words):
    finger = finger_with([3, 0, 0, 0], slip=True)
    if words == 'no input':
        finger.sample_s -= FOUR.input_timeout_s + 3
    else:
        finger.heard_s -= 60
    text, *channels = finger_markers(finger)
    assert text.text == f'index: {words}'
    assert rgb(text) == rgb(finger_markers(finger_with([0] * 4))[0])
    assert {marker.type for marker in channels} == {Marker.CUBE}


def test_slip_view_shows_a_real_finger_in_the_frame_of_its_samples_and_the_loss_of_them(bench):
    bench.start('slip_detector')
    bench.start_python('-m', 'slip_detector.nodes.view', '--port', '0')
    said = []
    bench.subscribe(MarkerArray, 'slip_view/taxels', said.append, event_qos(depth=1000))
    bench.listen(JointState, 'voltages', patient_qos())
    driver = bench.start_driver(parameters={'frame_id': 'index_tip', 'loop': 'true'}, others=1)

    def texts(frame):
        return {m.text for a in said for m in a.markers if m.text and m.header.frame_id == frame}

    def seen(words):
        return any(text.startswith(f'slip_detector: {words}') for text in texts('index_tip'))

    bench.wait_for(lambda: seen('rest') and seen('SLIP '), 'rest and a slip in the frame')
    assert len(said[-1].markers) == 1 + len(DetectorConfig().names)
    driver.end()
    del said[:]  # On a busy machine there may have been a silence before.
    bench.wait_for(lambda: seen('no input'), 'the silence to be told')
    assert {marker.type for marker in said[-1].markers[1:]} == {Marker.CUBE}
