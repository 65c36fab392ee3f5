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

"""Stamps, and which profiles of quality of service fit each other."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip('rclpy', reason='needs rclpy')

from rclpy.qos import QoSCompatibility, qos_check_compatible

from slip_detector.nodes.messages import (
    event_qos,
    heartbeat_qos,
    sensor_qos,
    stamp_ns,
    state_qos,
    time_message,
)


@given(st.integers(-(2**31) * 10**9, (2**31) * 10**9 - 1))
def test_a_stamp_holds_each_nanosecond(at_ns):
    stamp = time_message(at_ns)
    assert stamp_ns(stamp) == at_ns
    assert 0 <= stamp.nanosec < 10**9


@pytest.mark.parametrize(
    ('offered', 'wanted', 'fits'),
    [
        (sensor_qos(), sensor_qos(), True),
        (sensor_qos(), event_qos(), False),
        (event_qos(), sensor_qos(), True),
        (event_qos(), state_qos(), False),
        (state_qos(), event_qos(), True),
        (heartbeat_qos(0.2), state_qos(), True),
        (heartbeat_qos(0.2), state_qos(deadline_s=0.5), True),
        (heartbeat_qos(0.2), state_qos(deadline_s=0.1), False),
        (heartbeat_qos(0.2), heartbeat_qos(0.2), True),
        (heartbeat_qos(0.2), heartbeat_qos(0.1), False),
        (state_qos(deadline_s=0.2), heartbeat_qos(0.2), False),
    ],
)
def test_a_subscriber_may_ask_for_no_more_than_is_offered(offered, wanted, fits):
    compatibility, reason = qos_check_compatible(offered, wanted)
    assert (compatibility != QoSCompatibility.ERROR) == fits, reason
