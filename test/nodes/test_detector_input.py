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

"""Messages of any type as the detector's input, batches, and the driver that sends them."""

import itertools

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32MultiArray, Float64MultiArray, Header, MultiArrayDimension

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.nodes.messages import event_qos, stamp_ns, time_message
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources import open_source
from support.harness import PERIOD_NS, START_NS, reliable_qos


def started(bench, message_type, **parameters):
    """Start a detector and return its envelope and a publisher of its input."""
    envelope = bench.listen(JointState, 'slip_detector/envelope', reliable_qos())
    voltages = bench.node.create_publisher(message_type, 'voltages', reliable_qos())
    words = {'input_timeout_s': 60.0, **parameters}
    process = bench.start('slip_detector', parameters=words, reliable_samples=True)
    bench.wait_for(voltages.get_subscription_count, 'the detector to connect')
    return process, envelope, voltages


def settled(bench, envelope, voltages, message, at_ns):
    """Send one message over and over until decisions come; returns the next stamp."""
    while not envelope:
        message.header.stamp = time_message(at_ns)
        voltages.publish(message)
        at_ns += PERIOD_NS
        bench.executor.spin_once(timeout_sec=0.01)
    last_ns = at_ns - PERIOD_NS
    bench.wait_for(lambda: stamp_ns(envelope[-1].header.stamp) == last_ns, 'the last decision')
    return at_ns


def test_without_a_header_the_middlewares_stamp_counts(bench):
    process, envelope, voltages = started(
        bench,
        Float64MultiArray,
        input_type='std_msgs/msg/Float64MultiArray',
        input_field='data',
        channels=2,
    )
    before_ns = bench.node.get_clock().now().nanoseconds
    while len(envelope) < 5:
        voltages.publish(Float64MultiArray(data=[1.0, 2.0]))
        bench.executor.spin_once(timeout_sec=0.01)
    after_ns = bench.node.get_clock().now().nanoseconds
    stamps = [stamp_ns(decision.header.stamp) for decision in envelope]
    assert before_ns < stamps[0]
    assert stamps == sorted(stamps)
    assert stamps[-1] < after_ns
    # A batch has to say that it is one.
    voltages.publish(Float64MultiArray(data=[1.0, 2.0] * 3))
    said = 'a message has 6 channels, allowed: 2 (a batch needs layout.dim: sample of size 3, '
    bench.wait_for(lambda: said in process.log(), said)


def test_late_batches_are_rows_with_their_own_times_and_a_lost_one_is_bridged(bench):
    onsets = bench.listen(Header, 'slip_onset', event_qos())
    process, envelope, voltages = started(
        bench,
        Float32MultiArray,
        input_type='std_msgs/msg/Float32MultiArray',
        input_field='data',
        channels=4,
        threshold=1e-3,
        max_gap_s=60.0,
    )
    rows = np.full((400, 4), 2.0, np.float32)
    rows[200:] += np.random.default_rng(0).standard_normal((200, 4)).astype(np.float32)

    def send(batch):
        message = Float32MultiArray(data=batch.ravel().tolist())
        samples, channels = batch.shape
        message.layout.dim = [
            MultiArrayDimension(label='sample', size=samples, stride=batch.size),
            MultiArrayDimension(label='channel', size=channels, stride=channels),
        ]
        voltages.publish(message)

    sent = 0
    while not envelope:
        send(rows[:1])
        sent += 1
        bench.executor.spin_once(timeout_sec=0.01)
    # The decision on a step too small for slip is the last of those on single rows.
    step = rows[:1] + np.float32(1e-4)
    send(step)
    bench.wait_for(lambda: envelope[-1].position[0] > 0, 'the decision on the step')
    levels = []
    for begin in range(0, 400, 50):
        known = len(envelope)
        send(rows[:0])  # Nothing is lost with an empty one.
        send(rows[begin : begin + 50])
        bench.wait_for(lambda known=known: len(envelope) > known, 'the decision')
        levels.append(envelope[-1].position)
    bench.wait_for(lambda: onsets, 'the onset')
    # The batches came slower than the rate, and none was lost.
    assert 'missing' not in process.log()

    def levels_after(count):
        chain = SlipChain(DetectorConfig(channels=4))
        chain.update(np.concatenate([np.repeat(rows[:1], count, axis=0), step]))
        return chain.update(rows).level

    # Of the single rows those before the detector listened were not heard, and the number of rows
    # decides where the windows sum up again, which is a last bit.
    possible = [levels_after(1 + heard) for heard in range(sent)]
    same = [level for level in possible if np.array_equal(level[49::50], levels)]
    wanted = (same or possible)[0]
    np.testing.assert_array_equal(levels, wanted[49::50])
    assert np.all(wanted[249::50] > 0)
    onset = int(np.flatnonzero(wanted.min(axis=1) > 1e-3)[0])
    message_of_onset = envelope[-4 + (onset - 200) // 50]
    after_ns = stamp_ns(message_of_onset.header.stamp) - stamp_ns(onsets[0].stamp)
    assert after_ns == pytest.approx((49 - onset % 50) * PERIOD_NS, rel=0.3)
    send(rows[:50, :3])  # With a channel too few, it is lost.
    send(rows[:50])
    bench.wait_for(lambda: '50 samples missing, bridged' in process.log(), 'the lost batch')


def test_messages_without_the_field_are_counted_and_the_node_goes_on(bench):
    process, envelope, voltages = started(bench, JointState, input_field='position[2]', channels=1)
    stamps_ns = itertools.count(START_NS, PERIOD_NS)

    def told():
        # The detector may not have found the publisher yet.
        message = JointState(position=[1.0, 2.0])
        message.header.stamp = time_message(next(stamps_ns))
        voltages.publish(message)
        return 'no numbers at position[2]' in process.log()

    bench.wait_for(told, 'the log')
    message = JointState(position=[1.0, 2.0, 3.0])
    settled(bench, envelope, voltages, message, next(stamps_ns))
    assert len(envelope[-1].position) == 1


def test_the_drivers_batches_carry_the_same_samples(bench):
    heard = bench.listen(Float32MultiArray, 'voltages', reliable_qos())
    bench.start_driver(parameters={'samples_per_message': 7, 'rate': 4.0})
    samples = open_source(DriverConfig(source='scene')).read(10**6).volts
    full, rest = divmod(len(samples), 7)
    bench.wait_for(lambda: len(heard) == full + (rest > 0), 'all batches')
    for message in heard:
        assert [dimension.label for dimension in message.layout.dim] == ['sample', 'channel']
    sizes = [message.layout.dim[0].size for message in heard]
    assert sizes == [7] * full + [rest] * (rest > 0)
    rows = np.concatenate([np.reshape(message.data, (-1, 16)) for message in heard])
    np.testing.assert_array_equal(rows, samples.astype(np.float32))
