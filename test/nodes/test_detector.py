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

"""The detector node as a process of its own, fed over DDS."""

import dataclasses
import itertools
import os

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float32MultiArray, Float64MultiArray, Header

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.nodes.messages import event_qos, stamp_ns
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources import open_source
from support.harness import (
    PERIOD_NS,
    ROOT,
    START_NS,
    Detected,
    batch_of,
    patient_state_qos,
    reliable_qos,
)
from support.interfaces import PILLAR, PILLARS, build


@pytest.fixture(scope='module')
def rows():
    """The plate scene around the start of motion: rest, slip, rest, 1.3 s."""
    samples = open_source(DriverConfig(source='scene')).read(10_000)
    start = int(np.flatnonzero(samples.truth)[0])
    end = int(np.flatnonzero(samples.truth)[-1])
    return np.concatenate(
        [samples.volts[start - 60 : start + 180], samples.volts[end - 60 : end + 200]]
    )


def without_repeats(states):
    """Drop states that only repeat the one before, as the heartbeat does."""
    return [state for state, _ in itertools.groupby(map(bool, states))]


def offline(rows):
    """Run the same rows through the chain without ROS, from rest."""
    chain = SlipChain(DetectorConfig())
    chain.update(rows[:1])
    return chain.update(rows)


def test_every_topic_says_what_the_chain_decides_and_what_does_not_fit_is_dropped(bench, rows):
    result, config = offline(rows), DetectorConfig()
    columns = {f'slip/group/{name}': result.groups[:, g] for g, name in enumerate(config.groups)}
    columns |= {f'slip/channel/ch{c + 1}': result.channels[:, c] for c in range(16)}
    heard = {topic: bench.listen(Bool, topic, patient_state_qos()) for topic in columns}
    onsets = bench.listen(Header, 'slip_onset', event_qos())
    detected = Detected(bench, parameters={'input_timeout_s': 60.0})
    columns['slip'], heard['slip'] = result.slip, detected.slip
    bench.wait_for(lambda: all(heard.values()), 'the first state of each topic')
    begin = at_ns = detected.settle(rows[0], START_NS, PERIOD_NS)
    for i, row in enumerate(rows):
        if i % 50 == 10:
            detected.send(row[:15], at_ns)
            detected.send(row, at_ns, names=[f'taxel_{i}' for i in range(16)])
            detected.send(row + 1.0, at_ns - 5 * PERIOD_NS)
        at_ns = detected.send_all([row], at_ns, PERIOD_NS)

    wanted = {topic: without_repeats([False, *states]) for topic, states in columns.items()}
    assert sum(wanted['slip']) >= 1
    bench.wait_for(
        lambda: all(
            without_repeats(message.data for message in heard[topic]) == states
            for topic, states in wanted.items()
        ),
        'the changes of all topics',
    )
    first = np.flatnonzero(np.diff(result.slip, prepend=False) & result.slip)
    bench.wait_for(lambda: len(onsets) == len(first), 'the onsets')
    assert [stamp_ns(onset.stamp) for onset in onsets] == [begin + PERIOD_NS * k for k in first]
    sent = detected.envelope[-len(rows) :]
    levels = [message.position for message in sent]
    np.testing.assert_allclose(levels, result.level, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal([message.effort for message in sent], result.channels)
    assert list(sent[0].name) == list(config.names)
    log = detected.process.log()
    assert 'a message has 15 channels, allowed: 16: dropped' in log
    assert 'the channels of a message are taxel_0, ' in log
    assert 'the stamp of a message does not fit those before: dropped' in log


def test_the_shipped_file_holds_the_defaults_and_where_the_taxels_are():
    shipped = DetectorConfig.from_yaml(ROOT / 'config' / 'slip_detector.yaml')
    assert dataclasses.replace(shipped, taxel_positions_m=()) == DetectorConfig()
    assert len(shipped.taxel_positions_m) == 3 * shipped.channels


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


PILLARS_FILE = ROOT / 'config' / 'sensors' / 'papillarray.yaml'
PILLARS_TOPIC = '/hub_0/sensor_0'


def test_a_drivers_own_messages_are_decided_on_by_its_parameter_file(bench, tmp_path, monkeypatch):
    definitions = {'msg/PillarState.msg': PILLAR, 'msg/SensorState.msg': PILLARS}
    build(tmp_path, 'sensor_interfaces', definitions)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv('PYTHONPATH', str(tmp_path), prepend=os.pathsep)
    from sensor_interfaces.msg import PillarState, SensorState

    config = DetectorConfig.from_yaml(PILLARS_FILE)
    slip = bench.listen(Bool, 'slip', patient_state_qos())
    envelope = bench.listen(JointState, 'slip_detector/envelope', reliable_qos())
    publisher = bench.node.create_publisher(SensorState, PILLARS_TOPIC, reliable_qos())
    words = ['--params-file', PILLARS_FILE, '-r', f'voltages:={PILLARS_TOPIC}']
    given = {'input_timeout_s': 60.0, 'max_gap_s': 60.0}  # As fast as the machine is.
    bench.start('slip_detector', *words, parameters=given, reliable_samples=True)

    def send(row):
        pillars = [PillarState(dx=dx, dy=dy) for dx, dy in row.reshape(2, 9).T.tolist()]
        publisher.publish(SensorState(pillars=pillars))

    times_s = np.arange(70) / config.sample_rate_hz
    wave = 0.002 * np.sin(2 * np.pi * 60.0 * times_s) * (times_s > 0.06)
    rows = (np.linspace(-1.0, 1.0, 18) + wave[:, np.newaxis]).astype(np.float32)
    bench.wait_for(lambda: send(rows[0]) or envelope, 'a decision')
    chain = SlipChain(config)
    chain.update(rows[:1].astype(np.float64))
    wanted = chain.update(rows.astype(np.float64))
    assert wanted.slip.any()
    for row in rows:
        send(row)
    last = wanted.level[-1, 0]
    bench.wait_for(lambda: np.isclose(envelope[-1].position[0], last), 'the last decision')
    # The first row came some times more, and left the chain at rest.
    levels = [heard.position for heard in envelope[-len(rows) :]]
    bench.wait_for(lambda: slip[-1].data, 'slip')
    np.testing.assert_allclose(levels, wanted.level, rtol=1e-9, atol=1e-12)
