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

"""Parameters of the detector, changed while it runs."""

import numpy as np
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import parameter_dict_from_yaml_file

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.files import shared_folder
from support.harness import PERIOD_NS, START_NS, Detected


def test_files_are_loaded_whole_as_ros2_param_load_sends_them(bench):
    process = bench.start('slip_detector')
    for file in ('onset', 'sure', 'grasp', 'slip_detector', 'xela_uskin', 'onset'):
        path = shared_folder() / 'config' / f'{file}.yaml'
        sent = parameter_dict_from_yaml_file(str(path))  # of all nodes
        request = SetParameters.Request(parameters=[*sent.values()])
        results = bench.ask(SetParameters, 'slip_detector/set_parameters', request).results
        refused = {name for name, each in zip(sent, results, strict=True) if not each.successful}
        values = DetectorConfig.from_yaml(path).to_parameters()
        assert refused == sent.keys() - values.keys(), file
        taken = [*(sent.keys() - refused)]
        wanted = [values[name] for name in taken]
        assert bench.values_of('slip_detector', *taken) == wanted, file
    assert 'decision failed' not in process.log()


def test_a_request_is_taken_whole_or_refused_for_good(bench):
    process = bench.start('slip_detector')
    wrong = {'threshold': 0.7, 'gain': -1.0, 'grip_n': 2.0, 'autostart': False}
    taken, *reasons = (each.reason for each in bench.set_each('slip_detector', wrong))
    assert taken == reasons[0] == 'parameter gain is -1, allowed: 1e-06 to 1e+06'
    assert 'it is a parameter of grasp_controller' in reasons[1]
    assert not any(each.successful for each in bench.set_each('slip_detector', wrong))
    assert bench.values_of('slip_detector', 'threshold', 'decision') == [0.5, 'mean']
    for values in ({'decision': 'evidence'}, {'gain': 1.0}, {'noise_floor': [0.001]}):
        assert bench.set_each('slip_detector', values)[0].successful
    assert process.log().count('no noise_floor') == 1


def test_another_type_of_input_is_taken_while_it_runs(bench):
    detected = Detected(bench)
    detected.settle(np.ones(16), START_NS, PERIOD_NS)
    batches = {'input_type': 'std_msgs/msg/Float32MultiArray', 'input_field': 'data'}
    assert bench.set_whole('slip_detector', batches).successful
    bench.wait_for(lambda: not detected.valid[-1].data, 'slip_valid to fall')
    driver = {
        'source': 'scene',
        'samples_per_message': 4,
        'loop': 'true',
        'wait_for_subscribers': 1,
    }
    bench.start('slip_driver', parameters=driver, reliable_samples=True)
    bench.wait_for(lambda: detected.valid[-1].data, 'slip_valid')
    assert 'voltages that are no' not in detected.process.log()
