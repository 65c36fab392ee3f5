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

"""The relay: a change for each change, and nothing else."""

from array import array

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from sensor_msgs.msg import JointState

from benchmarks.soak.relay import Relay

pytestmark = pytest.mark.nodes


def test_only_changes_of_the_state_are_published():
    said = []

    class Publisher:
        def publish(self, message):
            said.append(message.data)

    relay = object.__new__(Relay)
    relay._on, relay._slip = False, Publisher()
    for effort in (0.0, 1.0, 1.0, 0.0, 0.0, 1.0):
        relay._on_voltages(JointState(effort=array('d', [effort])))
    assert said == [True, False, True]
