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

import tracemalloc

import numpy as np
import pytest

from slip_detector.chain.samples import Samples
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.recordings import (
    bag_recording,
    csv_recording,
    is_recording,
    npz_recording,
    open_recording,
    write_recording,
)
from support.recorded import VOLTS, complaint, read_recording, save_npz, save_text


def test_keys_are_taken_from_the_configuration(tmp_path):
    path = tmp_path / 'a.npz'
    np.savez(path, tactile=VOLTS, fs=60.0, label=[1, 0, 0], slip=[0, 0, 1])
    keys = RecordingConfig(
        recording_volts_key='tactile', recording_rate_key='fs', recording_truth_key='label'
    )
    recording = read_recording(path, keys)
    assert recording.sample_rate_hz == 60.0
    np.testing.assert_array_equal(recording.truth, [True, False, False])


def test_bad_samples_are_kept_for_the_chain_to_judge(tmp_path):
    volts = np.array([[1.0, np.nan], [np.inf, 2.0]])
    in_npz = read_recording(save_npz(tmp_path / 'a.npz', volts=volts, slip=None))
    in_csv = read_recording(save_text(tmp_path / 'a.csv', 'time_s,a,b\n0,1,nan\n1,inf,2\n'))
    np.testing.assert_array_equal(in_npz.volts, volts)
    np.testing.assert_array_equal(in_csv.volts, volts)


def test_a_missing_file_a_folder_and_an_unknown_ending_are_named(tmp_path):
    folder = tmp_path / 'folder.npz'
    folder.mkdir()
    assert complaint(tmp_path / 'no.npz') == ': cannot be read (No such file or directory)'
    assert complaint(folder) == ': cannot be read (Is a directory)'
    allowed = 'allowed: .npz, .csv, .mcap, .db3 or the folder of a bag'
    assert complaint(tmp_path / 'a.wav') == f': is .wav, {allowed}'
    assert complaint(tmp_path / 'bag') == f': is without ending, {allowed}'


@pytest.mark.parametrize('ending', ['.npz', '.mcap', '.db3'])
def test_a_device_is_no_recording_but_by_its_lines(tmp_path, ending):
    path = tmp_path / f'a{ending}'
    path.symlink_to('/dev/zero')
    assert complaint(path) == ': is no file, allowed: a file or the folder of a bag'


def test_a_recording_is_known_by_its_ending_or_its_metadata(tmp_path):
    for ending in ('.npz', '.csv', '.mcap', '.db3'):
        assert is_recording(tmp_path / f'a{ending}')
    assert not is_recording(tmp_path / 'a.yaml')
    assert not is_recording(tmp_path)
    (tmp_path / 'metadata.yaml').touch()
    assert is_recording(tmp_path)


@pytest.mark.parametrize('ending', ['.mcap', '.db3', '.npz', '.csv'])
def test_memory_does_not_grow_with_the_length(tmp_path, monkeypatch, ending):
    if ending in ('.mcap', '.db3'):
        pytest.importorskip('rosbags', reason='needs rosbags')
    # A recording that is short can have many pieces so.
    for module in (bag_recording, csv_recording, npz_recording):
        monkeypatch.setattr(module, 'PIECE_ROWS', 2048)

    def written(n):
        path = tmp_path / f'{n}{ending}'
        volts = 4.3 + 1e-3 * np.random.default_rng(0).standard_normal((n, 4))
        rows = Samples(volts, np.arange(n) * 2_500_000, np.arange(n) % 200 < 100)
        write_recording(path, [rows], 400.0, 'abcd')
        return path

    def rows_of(path):
        return sum(len(piece.volts) for piece in open_recording(path).pieces())

    def peak(n):
        path = written(n)
        tracemalloc.start()
        count = rows_of(path)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert count == n
        return most

    rows_of(written(100))  # What is loaded and kept once.
    short, long = peak(7500), peak(25_000)
    assert long < 1.2 * short
