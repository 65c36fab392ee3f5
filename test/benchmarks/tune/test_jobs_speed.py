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

"""Hours of recording evaluated in a second."""

import pytest

from benchmarks.tune.jobs_speed import measure_jobs


def test_both_formats_are_evaluated_with_each_number_of_jobs_to_the_same_figures():
    pytest.importorskip('rosbags', reason='needs rosbags')
    result = measure_jobs(recordings=2, minutes=0.2, rounds=1)
    assert result['same']
    for ending in ('npz', 'mcap'):
        assert set(result[ending]['hours_per_s']) == {'1', '2'}
        assert all(speed > 0.0 for speed in result[ending]['hours_per_s'].values())
        # 16 values of 8 bytes a row at least.
        assert result[ending]['bytes_per_hour'] > 3600 * 380 * 16 * 8
    assert result['memory_mib'] > 50.0
