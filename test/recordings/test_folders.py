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

"""Recordings of a command line, by their folders."""

import pytest

from slip_detector.recordings import open_recording
from slip_detector.recordings.folders import recording_sets


def test_files_of_one_folder_are_one_set_and_folders_are_sorted(tmp_path):
    for name in ('x/b.npz', 'x/a.csv', 'x/notes.txt', 'y/c.npz', 'z/x/d.npz'):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    x, y, zx = tmp_path / 'x', tmp_path / 'y', tmp_path / 'z' / 'x'
    given_files = [str(x / 'b.npz'), str(y / 'c.npz'), str(y / '..' / 'x' / 'a.csv')]
    assert {k: [f.name for f in v] for k, v in recording_sets(given_files).items()} == {
        'x': ['b.npz', 'a.csv'],
        'y': ['c.npz'],
    }
    assert recording_sets([str(x)]) == {'x': [x / 'a.csv', x / 'b.npz']}
    # Two folders of one name are told apart.
    assert list(recording_sets([str(x), str(y), str(zx)])) == [str(x), 'y', str(zx)]


def test_a_folder_with_nothing_but_bags_of_ros_1_is_refused_with_how_to_convert_them(tmp_path):
    (tmp_path / 'trial.bag').touch()
    ((bag,),) = recording_sets([str(tmp_path)]).values()
    with pytest.raises(ValueError, match=r'trial[.]bag: is a bag of ROS 1, .* rosbags-convert'):
        open_recording(bag)
