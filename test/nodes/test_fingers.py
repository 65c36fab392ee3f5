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

"""Several fingers in one process of drivers and one of detectors."""

import itertools

from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.nodes.messages import sensor_qos, stamp_ns, state_qos

NAMES = 'thumb, index,little'
FINGERS = ('thumb', 'index', 'little')


def start(bench, name, **parameters):
    words = ('-r', '__ns:=/left', '--', '--fingers', NAMES)
    return bench.start(name, *words, parameters=parameters)


def test_each_finger_has_nodes_and_parameters_of_its_own_and_all_samples_come(bench):
    valid, voltages = {}, {}
    for finger in FINGERS:
        valid[finger] = bench.listen(Bool, f'left/{finger}/slip_valid', state_qos())
        voltages[finger] = bench.listen(JointState, f'left/{finger}/voltages', sensor_qos())
    detector = start(bench, 'slip_detector')
    driver = start(bench, 'slip_driver', source='scene', wait_for_subscribers=2, loop='true')
    for finger in FINGERS:
        bench.wait_for(
            lambda finger=finger: valid[finger] and valid[finger][-1].data, f'{finger}/slip_valid'
        )
        bench.wait_for(lambda finger=finger: len(voltages[finger]) > 400, f'the input of {finger}')
    for heard in voltages.values():
        stamps_ns = [stamp_ns(message.header.stamp) for message in heard]
        steps_ns = [b - a for a, b in itertools.pairwise(stamps_ns)]
        assert max(steps_ns) - min(steps_ns) <= 1
    # A change at one finger is no change at another.
    bench.set_each('left/index/slip_detector', {'valid_range_v': [-2.0, -1.0]})
    bench.wait_for(lambda: not valid['index'][-1].data, 'the finger to be invalid')
    others = [valid[finger] for finger in ('thumb', 'little')]
    for heard in others:
        heard.clear()
    bench.wait_for(lambda: all(len(heard) > 10 for heard in others), 'more of the others')
    assert all(heard[-1].data for heard in others)
    for process in (detector, driver):
        process.end_quietly()
        assert 'dropped' not in process.log()


def test_drivers_end_when_all_have_played(bench):
    process = start(bench, 'slip_driver', source='scene', rate=20.0)
    assert process.wait() == 0
    assert process.log().count('played all') == len(FINGERS)
