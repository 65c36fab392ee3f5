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

"""The driver's samples, one by one and in batches."""

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from sensor_msgs.msg import JointState
from std_msgs.msg import Float32MultiArray

from slip_detector.nodes.voltages import Voltages
from slip_detector.recordings.messages import FieldReader
from support.harness import patient_qos

NAMES = ['left', 'right', 'tip']


def published(bench, samples_per_message):
    """Return what samples are published with, connected, and the list of what is received."""
    message_type = JointState if samples_per_message == 1 else Float32MultiArray
    heard = bench.listen(message_type, 'voltages', patient_qos())
    voltages = Voltages(bench.node, 'tip', samples_per_message)
    (subscription,) = bench.node.subscriptions
    bench.wait_for(
        lambda: voltages.get_subscription_count() and subscription.get_publisher_count(),
        'the subscription',
    )
    return voltages, heard


def test_each_sample_goes_out_at_once_with_its_stamp_and_names(bench):
    voltages, heard = published(bench, 1)
    rows = np.random.default_rng(0).standard_normal((5, 3))
    for k, row in enumerate(rows):
        assert voltages.completed_by_next
        voltages.publish(k + 1, NAMES, row)
    voltages.flush()
    bench.wait_for(lambda: len(heard) == len(rows), 'all samples')
    np.testing.assert_array_equal([message.position for message in heard], rows)
    assert [message.header.stamp.nanosec for message in heard] == [1, 2, 3, 4, 5]
    assert all(message.name == NAMES for message in heard)
    assert heard[0].header.frame_id == 'tip'


def test_names_that_change_are_those_of_the_next_message(bench):
    voltages, heard = published(bench, 1)
    voltages.publish(0, NAMES, np.zeros(3))
    voltages.publish(0, ['a', 'b'], np.zeros(2))
    bench.wait_for(lambda: len(heard) == 2, 'both')
    assert [list(message.name) for message in heard] == [NAMES, ['a', 'b']]


def test_batches_are_full_but_for_the_last_and_read_back_as_rows(bench):
    voltages, heard = published(bench, 3)
    rows = np.random.default_rng(0).standard_normal((7, 2))
    completed = []
    for row in rows:
        completed.append(voltages.completed_by_next)
        voltages.publish(0, NAMES, row)
    assert completed == [False, False, True, False, False, True, False]
    voltages.flush()
    voltages.flush()  # Nothing is left.
    bench.wait_for(lambda: len(heard) == 3, 'all batches')
    parts = [FieldReader('data')(message) for message in heard]
    assert [len(part) for part in parts] == [3, 3, 1]
    np.testing.assert_array_equal(np.concatenate(parts), rows.astype(np.float32))
