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

"""Opening of recordings: by their endings, however long they are."""

import os
import tracemalloc

import numpy as np
import pytest

from slip_detector.chain.samples import Samples
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.recordings import (
    array_recordings,
    bag_recording,
    group_recordings,
    open_recording,
    write_recording,
)
from support.config_cases import message_of
from support.recorded import VOLTS, complaint, read_recording, save_rows


def test_keys_are_taken_from_the_configuration(tmp_path):
    path = tmp_path / 'a.npz'
    np.savez(path, tactile=VOLTS, fs=60.0, label=[1, 0, 0], slip=[0, 0, 1])
    keys = {'recording_volts_key': 'tactile', 'recording_rate_key': 'fs'}
    config = RecordingConfig(**keys, recording_truth_key='label')
    recording, rows = read_recording(path, config)
    assert recording.sample_rate_hz == 60.0
    np.testing.assert_array_equal(rows.truth, [True, False, False])


def test_a_missing_file_a_folder_and_an_unknown_ending_are_named(tmp_path):
    folder = tmp_path / 'folder.npz'
    folder.mkdir()
    for missing in ('no.npz', 'no', 'no.wav'):
        assert complaint(tmp_path / missing) == ': cannot be read (No such file or directory)'
    assert complaint(folder) == ': cannot be read (Is a directory)'
    allowed = 'allowed: .npz, .csv, .mcap, .db3, .bag or the folder of a bag'
    for name, ending in (('a.wav', '.wav'), ('bag', 'without ending')):
        (tmp_path / name).touch()
        assert complaint(tmp_path / name) == f': is {ending}, {allowed}'


@pytest.mark.parametrize('ending', ['.npz', '.csv', '.mcap', '.db3', '.bag', '.labels.yaml'])
def test_a_pipe_or_a_device_is_no_recording_and_no_file_of_labels(tmp_path, ending):
    pipe, device = tmp_path / f'pipe{ending}', tmp_path / f'device{ending}'
    os.mkfifo(pipe)
    device.symlink_to('/dev/zero')
    for path in (pipe, device):
        recording = path.with_name(path.name.replace('.labels.yaml', '.npz'))
        for config in (None, RecordingConfig(recording_labels=str(path))):
            message = message_of(open_recording, recording, config)
            assert message == f'{path}: is no file, allowed: a file'


def test_the_recordings_of_a_folder_and_of_the_folders_in_it_are_sets(tmp_path):
    # A bag has metadata; one whose recorder was killed has not.
    bags = 'z/v/metadata.yaml', 'z/w/w_0.mcap'
    for name in ('x/b10.npz', 'x/b9.csv', 'x/notes.txt', 'y/c.db3', 'z/x/d.npz', *bags):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    x, y, z = (tmp_path / name for name in 'xyz')
    assert group_recordings([z]) == {'z': [z / 'v', z / 'w'], 'x': [z / 'x' / 'd.npz']}
    # Numbers count by their value, and what is given twice is there once.
    given_files = [x / 'b10.npz', y / 'c.db3', x / 'b9.csv', y / '..' / 'x' / 'b10.npz', y]
    sets = {
        name: [file.name for file in some] for name, some in group_recordings(given_files).items()
    }
    assert sets == {'x': ['b9.csv', 'b10.npz'], 'y': ['c.db3']}
    # Two folders of one name are told apart.
    assert list(group_recordings([x, y, z / 'x'])) == [str(x), 'y', str(z / 'x')]
    said = 'cannot be read (No such file or directory)'
    assert message_of(group_recordings, [x, z / 'no.npz']) == f'{z / "no.npz"}: {said}'


@pytest.mark.parametrize('ending', ['.mcap', '.csv'])
def test_memory_does_not_grow_with_the_length(tmp_path, monkeypatch, ending):
    pytest.importorskip('rosbags', reason='needs rosbags')
    # A recording that is short can have many pieces so.
    for module in (bag_recording, array_recordings):
        monkeypatch.setattr(module, 'PIECE_ROWS', 512)

    def peak(n):
        path = tmp_path / f'{n}{ending}'
        volts = 4.3 + 1e-3 * np.random.default_rng(0).standard_normal((n, 4))
        samples = Samples(volts, np.arange(n) * 2_500_000, np.arange(n) % 200 < 100)
        write_recording(path, [samples], 400.0, 'abcd')
        tracemalloc.start()
        count = sum(len(piece.volts) for piece in open_recording(path).pieces())
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert count == n
        return most

    peak(100)  # What is loaded and kept once.
    short, long = peak(2000), peak(12_000)
    assert long < 1.2 * short


SMALL = RecordingConfig(recording_limit_mb=20.0, recording_resample=True)


#: Rows of which a tenth come 90 ms apart: such gaps are bridged.
BRIDGED_NS = np.cumsum(np.repeat([1000, 90_000_000], [900, 100]))


@pytest.mark.parametrize(
    ('n', 'stamps_ns', 'rate_hz', 'what'),
    [
        (200_000, None, 380.0, 'volts takes 26 MB'),
        (1000, BRIDGED_NS, 1e6, 'what bridges the gaps takes'),
        (1000, None, 10.0, 'a stretch to resample takes'),
    ],
)
def test_what_is_larger_than_the_limit_is_refused(tmp_path, n, stamps_ns, rate_hz, what):
    path = save_rows(tmp_path / 'a.npz', np.zeros((n, 16)), stamps_ns, rate_hz)
    chain_hz = max(10_000.0, rate_hz)
    said = message_of(lambda: next(open_recording(path, SMALL).pieces(chain_hz)))
    assert said.startswith(f'{path}: {what}')
    assert 'allowed: 20 MB (recording_limit_mb)' in said
