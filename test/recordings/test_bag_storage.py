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

"""Bags: whole, compressed, split, of ROS 1, cut off, damaged, or none at all."""

import contextlib
import re
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip('rosbags', reason='needs rosbags')

from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin

from slip_detector.recordings import open_recording, write_recording
from slip_detector.recordings.bag_storage import Topic, typestore_of
from slip_detector.recordings.writing import BagWriter
from support.bags import JOINT_STATE, NAMES, PLUGINS, Bag, check_same, gathered, rows


def read_of(path):
    """Return the readable rows, and the one-line message about the rest."""
    recording = open_recording(path)
    read = gathered(recording)
    assert '\n' not in recording.counts.damage
    return read, recording.counts.damage


@pytest.mark.parametrize(
    'mode', [CompressionMode.FILE, CompressionMode.MESSAGE, CompressionMode.STORAGE]
)
@pytest.mark.parametrize('plugin', PLUGINS)
def test_bags_that_the_recorder_compressed_are_read(tmp_path, plugin, mode):
    if (plugin, mode) == (StoragePlugin.SQLITE3, CompressionMode.STORAGE):
        pytest.skip('a database has no such compression')
    written, bag = rows(200), Bag(tmp_path / 'a', plugin)
    bag.writer.set_compression(mode, CompressionFormat.ZSTD)
    with bag:
        bag.write_rows(written)
    check_same(gathered(open_recording(tmp_path / 'a')), written)


def test_a_bag_of_ros_1_is_read_with_names_and_truth(tmp_path):
    written = rows(300)
    with Bag(tmp_path / 'a.bag') as bag:
        bag.write_rows(written, '/left')
    recording = open_recording(tmp_path / 'a.bag')
    assert recording.channel_names == NAMES
    check_same(gathered(recording), written)


@pytest.mark.parametrize('ending', ['.mcap', '.db3'])
def test_a_bag_that_was_split_into_files_is_one_recording(tmp_path, ending):
    written = rows(900)
    folder = tmp_path / 'split'
    folder.mkdir()
    for k in range(3):
        part = written.take(slice(300 * k, 300 * (k + 1)))
        # More than nine files: their numbers count, not their letters.
        write_recording(folder / f'split_{k + 8}{ending}', [part], 380.0, NAMES)
    check_same(gathered(open_recording(folder / f'split_8{ending}')), written.take(slice(300)))
    (folder / 'metadata.yaml').write_text('rosbag2_bagfile_information: {}')  # damaged
    check_same(gathered(open_recording(folder)), written)
    (folder / 'metadata.yaml').unlink()
    check_same(gathered(open_recording(folder)), written)


def test_without_rosbags_npz_is_read_and_a_bag_says_what_to_install(tmp_path):
    for ending in ('.mcap', '.npz'):
        write_recording(tmp_path / f'a{ending}', [rows(20)], 380.0, NAMES)
    code = (
        'import sys; sys.modules["rosbags"] = None\n'
        'from slip_detector.recordings import open_recording\n'
        'print(sum(len(piece.volts) for piece in open_recording(sys.argv[1] + ".npz").pieces()))\n'
        'try:\n    open_recording(sys.argv[1] + ".mcap")\n'
        'except ValueError as error:\n    print(error)\n'
    )
    command = [sys.executable, '-c', code, str(tmp_path / 'a')]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    install = f'{tmp_path / "a.mcap"}: bags need the package rosbags: pip install rosbags'
    assert done.stdout.splitlines() == ['20', install]


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """Write a bag in chunks as the live page does; tests cut and damage copies of it."""
    written = rows(900)
    bag = BagWriter(tmp_path_factory.mktemp('whole') / 'a', NAMES)
    for first in range(0, 900, 100):
        bag.write(written.take(slice(first, first + 100)))
        bag.flush()
    bag.close()
    return written, bag.path


@pytest.mark.parametrize('in_folder', [True, False])
def test_wherever_an_mcap_is_cut_off_its_beginning_is_read(tmp_path, whole, in_folder):
    written, file = whole
    content = file.read_bytes()
    path = tmp_path / 'a.mcap'
    for share in np.linspace(0.0, 1.0, 13)[:-1]:
        path.write_bytes(content[: int(share * len(content))])
        if share < 0.15:  # not even the definitions are there, or no sample is
            with pytest.raises(ValueError, match=r'a\.mcap is (damaged|cut off)'):
                open_recording(path)
            continue
        read, damage = read_of(tmp_path if in_folder else path)
        check_same(read, written.take(slice(len(read.volts))))
        # A chunk that is cut off is lost.
        assert len(read.volts) >= share * 900 - 120
        n = f'{len(read.volts)} samples up to'
        assert re.search(
            rf'^a\.mcap is cut off at byte \d+: what .* /voltages is lost, {n}', damage
        )


def test_an_mcap_is_read_up_to_a_damaged_chunk(tmp_path, whole):
    written, file = whole
    content = file.read_bytes()
    place = content.index(written.volts[450].tobytes())
    path = tmp_path / 'a.mcap'
    # Over the head of the next message.
    path.write_bytes(content[:place] + b'\xff' * 99 + content[place + 99 :])
    # Labels after the damage are no error.
    (tmp_path / 'a.labels.yaml').write_text('slip_s: [[0.5, 1.0], [2.0, 2.1]]')
    read, damage = read_of(path)
    np.testing.assert_array_equal(read.volts, written.volts[:400])
    assert read.truth.sum() == 190
    assert damage.startswith('a.mcap is damaged (')
    assert 'what followed on /voltages is lost, 400 samples up to' in damage


def test_a_bag_without_checksums_is_read_with_a_warning(tmp_path):
    with Bag(tmp_path / 'b') as bag:
        bag.write_rows(rows(20))
    recording = open_recording(tmp_path / 'b' / 'b.mcap')
    gathered(recording)
    assert recording.counts.doubts == 'b.mcap: without checksums, so that damage may go unseen'


# The metadata of a folder take longer to read than all of the file.
@pytest.mark.parametrize(('in_folder', 'step'), [(True, 227), (False, 73)])
def test_no_damage_changes_rows_unseen(tmp_path, in_folder, step):
    path = tmp_path / ('a' if in_folder else 'a.mcap')
    written = rows(60)
    write_recording(path, [written], 380.0, NAMES)
    file = path / 'a.mcap' if in_folder else path
    whole = file.read_bytes()
    seen = 0
    for place in range(0, len(whole), step):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << place % 8
        file.write_bytes(damaged)
        try:
            recording = open_recording(path)
            read = gathered(recording)
        except ValueError:
            seen += 1
            continue
        same = (
            read.volts.tobytes() == written.volts.tobytes()
            and np.array_equal(read.stamps_ns, written.stamps_ns)
            and (read.truth is None or np.array_equal(read.truth, written.truth))
        )
        counts = recording.counts
        seen += not same
        assert same or counts.damage or counts.dropped or counts.doubts, place
    assert seen > len(whole) / step / 2


@pytest.mark.parametrize('ending', ['.db3', '.bag'])
def test_of_a_cut_off_bag_of_another_kind_nothing_wrong_is_read(tmp_path, ending):
    written = rows(900)
    path = tmp_path / f'a{ending}'
    if ending == '.bag':
        with Bag(path) as bag:
            bag.write_rows(written)
    else:
        write_recording(path, [written], 380.0, NAMES)
    content = path.read_bytes()
    for share in np.linspace(0.0, 1.0, 13)[:-1]:
        path.write_bytes(content[: int(share * len(content))])
        with contextlib.suppress(ValueError):
            read, damage = read_of(path)
            np.testing.assert_array_equal(read.volts, written.volts[: len(read.volts)])
            assert damage


def test_where_a_definition_is_broken_that_of_ros_is_used_and_an_unknown_type_is_named():
    assert JOINT_STATE in typestore_of(Topic('/a', JOINT_STATE, 'MSG', 'no [type')).types
    for encoding in ('MSG', 'IDL', 'NONE'):
        with pytest.raises(ValueError, match=r'/a is skin/msg/Tactile, of which the bag has no d'):
            typestore_of(Topic('/a', 'skin/msg/Tactile', encoding, 'no [type'))
