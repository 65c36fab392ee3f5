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

"""examples/publish_voltages.py, with a detector that has the parameter file of the README."""

import itertools

import pytest
from std_msgs.msg import Bool

from support.harness import patient_state_qos
from support.pages import README, ROOT, file_shown

pytestmark = pytest.mark.nodes


def test_a_detector_with_the_parameters_of_the_readme_tells_its_slip(bench, tmp_path):
    parameters = tmp_path / 'my_sensor.yaml'
    parameters.write_text(file_shown(README, parameters.name), encoding='utf-8')
    slip = bench.listen(Bool, 'slip', patient_state_qos())
    valid = bench.listen(Bool, 'slip_valid', patient_state_qos())
    detector = bench.start('slip_detector', '--params-file', parameters)
    sensor = bench.start_python(ROOT / 'examples' / 'publish_voltages.py')
    bench.wait_for(lambda: valid and valid[-1].data, 'slip_valid')

    def changes():
        return [state for state, _ in itertools.groupby(message.data for message in slip)]

    bench.wait_for(lambda: len(changes()) > 4, 'slip to come and go twice')
    for process in (sensor, detector):
        process.end_quietly()
    assert 'dropped' not in detector.log()
