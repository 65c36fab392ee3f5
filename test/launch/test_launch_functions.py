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

"""What launch files call of the package; needs no launch."""

import time
from types import SimpleNamespace

import pytest

from slip_detector.nodes.launching import REPLAY, STARTS_S, end_launch_on_refusal, source_settings


@pytest.mark.parametrize(
    ('source', 'recording', 'in_file', 'expected'),
    [
        ('', 'a.bag', {}, ({'source': 'recording'}, REPLAY, True)),
        ('', 'a.bag', {'source': 'udp'}, ({'source': 'recording'}, REPLAY, True)),
        # Named in the file alone.
        ('', '', {'source': 'recording'}, ({}, REPLAY, True)),
        # Said, though it is the default; with more the detector hears batches, as its file says.
        ('recording', '', {'samples_per_message': 1}, ({'source': 'recording'}, REPLAY, True)),
        ('recording', '', {'samples_per_message': 2}, ({'source': 'recording'}, {}, True)),
        # What is given holds over the file.
        ('scene', '', {'source': 'recording'}, ({'source': 'scene', 'loop': True}, {}, False)),
        ('scene', '', {'loop': False}, ({'source': 'scene'}, {}, False)),
        ('', '', {'source': 'serial'}, ({}, {}, False)),
    ],
)
def test_a_detector_hears_what_is_played_and_only_a_simulation_is_repeated(
    source, recording, in_file, expected
):
    assert source_settings(source, recording, in_file) == expected


def test_a_node_that_refuses_to_start_ends_the_launch_unless_that_is_ending_or_long_begun():
    now_s, event = time.monotonic(), SimpleNamespace(returncode=255, process_name='slip_driver-1')
    end_launch_on_refusal(now_s, event, SimpleNamespace(is_shutdown=True))
    end_launch_on_refusal(now_s - STARTS_S, event, SimpleNamespace(is_shutdown=False))
    with pytest.raises(RuntimeError, match='slip_driver-1 ended with exit code 255'):
        end_launch_on_refusal(now_s, event, SimpleNamespace(is_shutdown=False))
