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

"""What comes from one finger: samples, levels, and the states that belong to them."""

import dataclasses
import itertools
import time

import numpy as np
import pytest
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.nodes import finger_topics
from slip_detector.nodes.finger_topics import FingerTopics
from slip_detector.nodes.messages import sensor_qos, state_qos
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.detectors import Finger
from support.harness import sample

TWO = DetectorConfig(channels=2, groups={'pair': (1, 2)}, passband_hz=(7, 50), stopbands_hz=[])
AT_NS = 10**18


class Sensor:
    """Publishes what a detector and its sensor do, and follows it as a page does."""

    def __init__(self, bench):
        self.bench = bench
        make = bench.node.create_publisher
        self.voltages = make(JointState, '/f/voltages', sensor_qos())
        self.truth = make(Bool, '/f/slip_truth', state_qos())
        self.envelope = make(JointState, '/f/slip_detector/envelope', sensor_qos())
        self.slip = make(Bool, '/f/slip', state_qos())
        self.valid = make(Bool, '/f/slip_valid', state_qos())
        self.group = make(Bool, '/f/slip/group/pair', state_qos())
        self.finger = Finger('/f/slip_detector', TWO)
        self.node = Node('page', context=bench.context)
        self.topics = FingerTopics(self.node, self.finger, '/f/voltages')
        every = (self.voltages, self.truth, self.envelope, self.slip, self.valid, self.group)
        self.bench.wait_for(lambda: all(p.get_subscription_count() for p in every), 'the page')

    def until(self, holds, what):
        def polled():
            self.topics.poll()
            return holds()

        self.bench.wait_for(polled, what)


@pytest.fixture
def sensor(bench):
    sensor = Sensor(bench)
    yield sensor
    sensor.topics.close()
    sensor.node.destroy_node()


def test_samples_levels_and_states_reach_the_finger(sensor):
    track = sensor.finger.track
    for k in range(4):
        sensor.truth.publish(Bool(data=k >= 2))
        sensor.voltages.publish(sample([4.0 + k, 5.0], AT_NS + k, 'tip'))
        sensor.slip.publish(Bool(data=k >= 3))
        levels, on = [0.5 * k, float('nan')], [float(k > 0), 0.0]
        sensor.envelope.publish(sample(levels, AT_NS + k, effort=on))
        sensor.until(lambda k=k: len(track.samples) > k and len(track.levels) > k, f'row {k}')
    assert track.samples.stamps_ns().tolist() == [AT_NS + k for k in range(4)]
    assert track.samples.field('volts').tolist() == [[4.0 + k, 5.0] for k in range(4)]
    assert track.samples.field('truth')[:, 0].tolist() == [False, False, True, True]
    assert track.levels.stamps_ns().tolist() == [AT_NS + k for k in range(4)]
    assert track.levels.field('level')[:, 0].tolist() == [0.0, 0.5, 1.0, 1.5]
    assert np.isnan(track.levels.field('level')[:, 1]).all()
    assert track.levels.field('on').tolist() == [[k > 0, False] for k in range(4)]
    assert track.levels.field('slip')[:, 0].tolist() == [False, False, False, True]
    assert sensor.finger.frame_id == 'tip'
    finger = sensor.finger
    for publisher in (sensor.valid, sensor.group):
        publisher.publish(Bool(data=True))
    sensor.until(lambda: finger.valid and finger.groups[0] and finger.onset_s, 'the states')
    # Groups that are no longer published are not on.
    finger.update_config(dataclasses.replace(TWO, publish_groups=False))
    sensor.topics.poll()
    assert not finger.groups[0]


def test_a_type_that_is_not_installed_is_reported_and_the_decisions_are_shown(sensor, monkeypatch):
    monkeypatch.setattr(finger_topics, 'FIT_PERIOD_S', 0.1)
    sensor.finger.update_config(DetectorConfig(channels=2, input_type='of_others/msg/Skin'))
    sensor.topics.poll()
    wanted = 'no volts are shown: of_others/msg/Skin is not installed here'
    assert sensor.finger.no_volts.startswith(wanted)
    sensor.valid.publish(Bool(data=True))
    sensor.until(lambda: sensor.finger.valid, 'slip_valid')

    finger, numbers = sensor.finger, itertools.count()

    def send(publisher, *values):
        publisher.publish(sample(values, AT_NS + 5_000_000 * next(numbers), effort=values))

    # Where levels come, samples come.
    sensor.until(lambda: send(sensor.envelope, 0.5, 0.5) or finger.sample_s > 0, 'a level')
    sensor.finger.update_config(DetectorConfig(channels=2))
    sensor.topics.poll()
    assert sensor.finger.no_volts == ''
    # Samples that do not fit come, too, and it is said what is wrong with them, and what fits.
    sensor.until(lambda: send(sensor.voltages, 4.0, 5.0, 6.0) or finger.offer, 'an offer')
    assert finger.offer == 'Take 3 channels at 200 Hz, one group'
    wrong = 'samples come, but they have 3 channels, the detector 2'
    assert finger.unfit == (pytest.approx(time.monotonic(), abs=5.0), wrong)
