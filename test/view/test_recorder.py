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


"""A recording that grows with the track of a finger."""

import shutil
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters import DetectorConfig
from slip_detector.recordings import open_recording
from slip_detector.view.detectors import Finger
from slip_detector.view.recorded_folder import Recorder
from support.full_disk import full_disk

CONFIG = DetectorConfig(channels=2, groups={'all': (1, 2)}, sample_rate_hz=380.0)


def came(finger, n):
    """Let samples come, which tell their number."""
    track = finger.track
    number = track.samples.appended + np.arange(n)
    track.add_samples(number * 10_000_000, np.stack([number, -number], axis=1), np.zeros(n))


@given(
    steps=st.lists(st.tuples(st.integers(0, 30), st.booleans()), min_size=1, max_size=8),
    before=st.integers(0, 20),
    since=st.integers(0, 20),
)
def test_each_row_from_the_first_on_is_written_once_with_the_label_that_was_held(
    tmp_path_factory, steps, before, since
):
    finger = Finger('/index/slip_detector', CONFIG)
    came(finger, before)
    since = min(since, before)
    recorder = Recorder(tmp_path_factory.mktemp('one') / 'slip_1', finger, since)
    truth = [False] * (before - since)
    slipping = False
    for n, slips in steps:
        came(finger, n)
        truth += [slipping] * n
        recorder.label(slips)
        slipping = slips
    recorder.close()
    assert recorder.rows == len(truth)
    assert recorder.slips == sum(after > before for before, after in pairwise([False, *truth]))
    if not truth:
        assert not recorder.path.exists()
    if len(truth) < 2:  # A bag of one row has no rate.
        return
    pieces = [*open_recording(recorder.path).rows()]
    numbers = np.concatenate([piece.volts[:, 0] for piece in pieces])
    assert numbers.tolist() == [*range(since, since + len(truth))]
    assert np.concatenate([piece.truth for piece in pieces]).tolist() == truth


def test_rows_that_the_track_has_no_more_are_counted(tmp_path):
    finger = Finger('/index/slip_detector', CONFIG)
    recorder = Recorder(tmp_path / 'rest_1', finger, 0)
    for _ in range(60):
        came(finger, 1000)
    recorder.write()
    kept = len(finger.track.samples)
    assert (recorder.rows, recorder.lost_rows) == (kept, 60_000 - kept)
    assert recorder.lost_rows > 0
    recorder.close()


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path):
    (tmp_path / 'file').write_text('')
    with pytest.raises(ValueError, match=r'file/rest_1: cannot be written'):
        Recorder(tmp_path / 'file' / 'rest_1', Finger('/index/slip_detector', CONFIG), 0)


def test_a_folder_that_another_process_has_just_made_is_left_to_it(tmp_path):
    theirs = tmp_path / 'rest_1'
    theirs.mkdir()
    (theirs / 'rest_1.mcap').write_text('theirs')
    with pytest.raises(ValueError, match=r'rest_1: cannot be written \(already exists\)'):
        Recorder(theirs, Finger('/index/slip_detector', CONFIG), 0)
    assert (theirs / 'rest_1.mcap').read_text() == 'theirs'


def test_a_recording_that_is_taken_away_meanwhile_is_not_kept(tmp_path):
    finger = Finger('/index/slip_detector', CONFIG)
    recorder = Recorder(tmp_path / 'rest_1', finger, 0)
    came(finger, 100)
    recorder.write()
    assert recorder.kept
    shutil.rmtree(tmp_path / 'rest_1')
    came(finger, 100)
    with pytest.raises(ValueError, match=r'rest_1: cannot be written .No such file'):
        recorder.write()
    assert not recorder.kept


def test_where_there_is_no_room_for_the_first_row_nothing_is_left(tmp_path):
    finger = Finger('/index/slip_detector', CONFIG)
    recorder = Recorder(tmp_path / 'rest_1', finger, 0)
    came(finger, 1000)
    with full_disk(1000), pytest.raises(ValueError, match='File too large'):
        recorder.write()
    assert not recorder.kept
    assert [*tmp_path.iterdir()] == []


def test_stamps_that_a_bag_cannot_hold_are_one_line(tmp_path):
    finger = Finger('/index/slip_detector', CONFIG)
    recorder = Recorder(tmp_path / 'rest_1', finger, 0)
    finger.track.add_samples(np.array([-5, 5]), np.zeros((2, 2)), np.zeros(2))
    with pytest.raises(ValueError, match=r'rest_1: cannot be written .a stamp is negative'):
        recorder.write()
