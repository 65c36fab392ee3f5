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

"""Several detectors beside one driver, each with a parameter file of its own."""

import signal

import pytest
from std_msgs.msg import Bool, Header

from slip_detector.nodes.messages import event_qos, stamp_ns, state_qos

THRESHOLDS = {'soon': 0.2, 'late': 2.0}


@pytest.fixture
def files(tmp_path):
    paths = {name: tmp_path / f'{name}.yaml' for name in THRESHOLDS}
    for name, threshold in THRESHOLDS.items():
        paths[name].write_text(
            f'/**:\n  ros__parameters: {{loop: false, threshold: {threshold}}}\n'
        )
    return paths


def test_each_file_is_a_detector_of_its_own_on_the_same_input(bench, files):
    valid = {name: bench.listen(Bool, f'index/{name}/slip_valid', state_qos()) for name in files}
    onsets = {
        name: bench.listen(Header, f'index/{name}/slip_onset', event_qos()) for name in files
    }
    names = ','.join(str(path) for path in files.values())
    detector = bench.start('slip_detector', '-r', '__ns:=/index', '--', '--configs', names)
    driver = bench.start(
        'slip_driver',
        '-r',
        '__ns:=/index',
        parameters={'source': 'scene', 'wait_for_subscribers': len(files)},
    )
    for name in files:
        bench.wait_for(
            lambda name=name: valid[name] and valid[name][-1].data, f'{name} to be valid'
        )
        bench.wait_for(lambda name=name: onsets[name], f'the slip of {name}')
    # Both saw the same samples, and the lower threshold was exceeded first.
    first_ns = {name: stamp_ns(heard[0].stamp) for name, heard in onsets.items()}
    assert first_ns['soon'] < first_ns['late']
    for name, threshold in THRESHOLDS.items():
        assert bench.values_of(f'index/{name}/slip_detector', 'threshold') == [threshold]
    assert driver.wait() == 0
    detector.signal(signal.SIGINT)
    assert detector.wait() == 0
    assert 'Traceback' not in detector.log()
