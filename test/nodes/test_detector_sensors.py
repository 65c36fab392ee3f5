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

"""The messages of a sensor's driver, built by the generators of ROS, as the detector's input."""

import os

import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import DetectorConfig
from support.harness import ROOT, patient_state_qos, reliable_qos
from support.interfaces import PILLAR, PILLARS, build

FILE = ROOT / 'config' / 'sensors' / 'papillarray.yaml'
TOPIC = '/hub_0/sensor_0'


def test_a_drivers_own_messages_are_decided_on_by_its_parameter_file(bench, tmp_path, monkeypatch):
    definitions = {'msg/PillarState.msg': PILLAR, 'msg/SensorState.msg': PILLARS}
    build(tmp_path, 'sensor_interfaces', definitions)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv('PYTHONPATH', str(tmp_path), prepend=os.pathsep)
    from sensor_interfaces.msg import PillarState, SensorState

    config = DetectorConfig.from_yaml(FILE)
    slip = bench.listen(Bool, 'slip', patient_state_qos())
    envelope = bench.listen(JointState, 'slip_detector/envelope', reliable_qos())
    publisher = bench.node.create_publisher(SensorState, TOPIC, reliable_qos())
    words = ['--params-file', FILE, '-r', f'voltages:={TOPIC}']
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
