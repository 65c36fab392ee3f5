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

"""The times of measure_reading are those of the whole recording."""

import pytest

from benchmarks.tune.reading_speed import measure_reading, write_labelled_noise
from slip_detector.recordings import open_recording


@pytest.mark.parametrize('ending', ['.mcap', '.npz'])
def test_the_whole_recording_is_written_and_read(tmp_path, ending):
    pytest.importorskip('rosbags', reason='needs rosbags')
    path = tmp_path / f'a{ending}'
    write_labelled_noise(path, seconds=30.0)
    recording = open_recording(path)
    pieces = list(recording.pieces(380.0))
    assert sum(len(piece.volts) for piece in pieces) == 11400
    assert recording.counts.stretches == 1
    assert sum(int(piece.truth.sum()) for piece in pieces) == 3800
    figures = measure_reading(path)
    assert figures['recorded_s'] == 30.0
    assert figures['times_real_time'] == pytest.approx(30.0 / figures['read_s'])
