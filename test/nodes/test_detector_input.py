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

import numpy as np
import pytest
from std_msgs.msg import Float32MultiArray, Float64MultiArray, Header

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.nodes.messages import event_qos, stamp_ns
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources import open_source
from support.harness import PERIOD_NS, Detected, batch_of, reliable_qos


def test_without_a_header_the_middlewares_stamp_counts(bench):
    given = {'input_type': 'std_msgs/msg/Float64MultiArray', 'input_field': 'data', 'channels': 2}
    detected = Detected(bench, {'input_timeout_s': 60.0, **given}, Float64MultiArray)
    envelope, voltages = detected.envelope, detected.voltages
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
    bench.wait_for(lambda: said in detected.process.log(), said)


def test_late_batches_are_rows_with_their_own_times_and_a_lost_one_is_bridged(bench):
    onsets = bench.listen(Header, 'slip_onset', event_qos())
    given = {'input_type': 'std_msgs/msg/Float32MultiArray', 'input_field': 'data', 'channels': 4}
    given |= {'threshold': 1e-3, 'max_gap_s': 60.0, 'input_timeout_s': 60.0}
    detected = Detected(bench, given, Float32MultiArray)
    envelope = detected.envelope
    rows = np.full((400, 4), 2.0, np.float32)
    rows[200:] += np.random.default_rng(0).standard_normal((200, 4)).astype(np.float32)

    def send(batch):
        detected.voltages.publish(batch_of(batch))

    bench.wait_for(lambda: send(rows[:1]) or envelope, 'a decision')
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
    assert 'missing' not in detected.process.log()
    chain = SlipChain(DetectorConfig(channels=4))
    chain.update(np.concatenate([rows[:1], step]))
    wanted = chain.update(rows).level
    np.testing.assert_allclose(levels, wanted[49::50], rtol=1e-9, atol=1e-12)
    onset = int(np.flatnonzero(wanted.min(axis=1) > 1e-3)[0])
    message_of_onset = envelope[-4 + (onset - 200) // 50]
    after_ns = stamp_ns(message_of_onset.header.stamp) - stamp_ns(onsets[0].stamp)
    assert after_ns == pytest.approx((49 - onset % 50) * PERIOD_NS, rel=0.3)
    send(rows[:50, :3])  # With a channel too few, it is lost.
    send(rows[:50])
    said = '50 samples missing, bridged'
    bench.wait_for(lambda: said in detected.process.log(), 'the lost batch')


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
