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
import functools
import shutil
import sqlite3
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip('rosbags', reason='needs rosbags')

from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from rosbags.typesys import Stores, get_typestore

from slip_detector.recordings import open_recording, write_recording
from slip_detector.recordings.bag_storage import Topic, typestore_of
from slip_detector.recordings.writing import BagWriter
from support.bags import JOINT_STATE, NAMES, PLUGINS, check_same, gathered, rows
from support.damaged_bags import MESSAGES, check_is_beginning, read_of, write_bag


@pytest.mark.parametrize(
    'mode', [CompressionMode.FILE, CompressionMode.MESSAGE, CompressionMode.STORAGE]
)
@pytest.mark.parametrize('plugin', PLUGINS)
def test_bags_that_the_recorder_compressed_are_read(tmp_path, plugin, mode):
    if (plugin, mode) == (StoragePlugin.SQLITE3, CompressionMode.STORAGE):
        pytest.skip('a database has no such compression')
    written, _ = write_bag(tmp_path / 'a', plugin, mode, n=200)
    check_same(gathered(open_recording(tmp_path / 'a')), written)


def write_ros_1(path, written):
    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types
    joints, bool_type = types[JOINT_STATE], 'std_msgs/msg/Bool'
    with Ros1Writer(path) as bag:
        volts = bag.add_connection('/left/voltages', JOINT_STATE, typestore=store)
        slip = bag.add_connection('/left/slip_truth', bool_type, typestore=store)
        for k, (at_ns, row) in enumerate(zip(written.stamps_ns, written.volts, strict=True)):
            if k == 0 or written.truth[k] != written.truth[k - 1]:
                state = types[bool_type](data=bool(written.truth[k]))
                bag.write(slip, int(at_ns), store.serialize_ros1(state, bool_type))
            stamp = types['builtin_interfaces/msg/Time'](*divmod(int(at_ns), 1_000_000_000))
            header = types['std_msgs/msg/Header'](seq=k, stamp=stamp, frame_id='tip')
            nothing = np.empty(0)
            message = joints(header, list(NAMES), np.array(row), nothing, nothing)
            bag.write(volts, int(at_ns), store.serialize_ros1(message, JOINT_STATE))


def test_a_bag_of_ros_1_is_read_with_names_and_truth(tmp_path):
    written = rows(300)
    write_ros_1(tmp_path / 'a.bag', written)
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
def whole_bag(tmp_path_factory):
    """Write a bag of each kind once; tests cut copies of it."""
    return functools.cache(
        lambda plugin, mode: write_bag(tmp_path_factory.mktemp('whole') / 'a', plugin, mode)
    )


def refusal(path):
    """Read a recording whole; return the one line with which it is refused, or ''."""
    try:
        recording = open_recording(path)
        assert all(len(piece.volts) == len(piece.stamps_ns) > 0 for piece in recording.pieces())
    except ValueError as error:
        said = str(error)
    else:
        said = ''
        assert '\n' not in recording.counts.damage
    assert not said or said.startswith(f'{path}: ')
    assert '\n' not in said
    return said


#: Of a file, up to which it is there.
SHARES = np.linspace(0.0, 1.0, 9)[:-1]


@pytest.mark.parametrize('in_folder', [True, False])
@pytest.mark.parametrize(
    'mode', [CompressionMode.NONE, CompressionMode.STORAGE, CompressionMode.MESSAGE]
)
def test_wherever_an_mcap_is_cut_off_its_beginning_is_read(tmp_path, whole_bag, mode, in_folder):
    written, whole = whole_bag(StoragePlugin.MCAP, mode)
    shutil.copytree(whole.parent, tmp_path / 'a')
    file = tmp_path / 'a' / whole.name
    content = whole.read_bytes()
    path = file.parent if in_folder else file
    counts = []
    for share in SHARES:
        file.write_bytes(content[: int(share * len(content))])
        error = refusal(path)
        if error:  # not even the definitions are there, or no sample is
            assert share < 0.2
            counts.append(0)
            continue
        read, damage = read_of(path)
        check_is_beginning(read, written)
        counts.append(len(read.volts))
        assert f'{file.name} is cut off at byte {file.stat().st_size}' in damage
        assert f'/voltages is lost, {len(read.volts)} messages up to' in damage
    assert counts == sorted(counts)
    # Little more is lost than what is not there: the cut is inside of a chunk.
    for share, count in zip(SHARES, counts, strict=True):
        assert count >= (share - 0.25) * MESSAGES


def test_an_mcap_in_chunks_of_lz4_that_is_cut_off_is_read(tmp_path):
    frame = pytest.importorskip('lz4.frame')
    written = rows(4000, truth=False)
    write_recording(tmp_path / 'a.mcap', [written], 380.0, NAMES)
    content = bytearray((tmp_path / 'a.mcap').read_bytes())
    begin = 17 + int.from_bytes(content[9:17], 'little')  # after the file's header
    length = int.from_bytes(content[begin + 1 : begin + 9], 'little')
    head, chunk = content[begin + 9 : begin + 37], content[begin + 49 : begin + 9 + length]
    packed = frame.compress(bytes(chunk))
    record = bytes(head) + b'\x03\0\0\0lz4' + len(packed).to_bytes(8, 'little') + packed
    cut = bytes(content[:begin]) + b'\x06' + len(record).to_bytes(8, 'little') + record[:-2000]
    (tmp_path / 'b.mcap').write_bytes(cut)
    read, damage = read_of(tmp_path / 'b.mcap')
    check_is_beginning(read, written)
    assert 2000 < len(read.volts) < 4000
    assert 'is cut off' in damage


def test_a_damaged_chunk_is_lost_alone(tmp_path):
    written = rows(900)
    bag = BagWriter(tmp_path / 'a', NAMES)
    for first in (0, 300, 600):
        bag.write(written.take(slice(first, first + 300)))
        bag.flush()
    bag.close()
    content = bag.path.read_bytes()
    place = content.index(written.volts[450].tobytes())
    bag.path.write_bytes(content[:place] + b'\0' + content[place + 1 :])
    for path in (tmp_path / 'a', bag.path):
        recording = open_recording(path)
        read = np.concatenate([samples.volts for samples in recording.rows()])
        np.testing.assert_array_equal(read, np.delete(written.volts, slice(300, 600), axis=0))
        assert 'a.mcap is damaged at byte ' in recording.counts.damage


def test_a_bag_without_checksums_is_read_with_a_warning(tmp_path):
    _, file = write_bag(tmp_path / 'b', StoragePlugin.MCAP, n=200)
    recording = open_recording(file)
    gathered(recording)
    assert recording.counts.warnings == 'b.mcap has no checksums, so that damage may go unseen'


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
        assert same or counts.damage or counts.dropped or counts.warnings, place
    assert seen > len(whole) / step / 2


@pytest.mark.parametrize(
    ('plugin', 'mode', 'repair'),
    [
        (StoragePlugin.SQLITE3, CompressionMode.NONE, 'sqlite3 a.db3 .recover | sqlite3 repaired'),
        (StoragePlugin.MCAP, CompressionMode.FILE, 'zstd -d a.mcap.zstd'),
    ],
)
def test_a_bag_that_cannot_be_read_in_part_says_what_repairs_it(tmp_path, plugin, mode, repair):
    _, file = write_bag(tmp_path / 'a', plugin, mode)
    content = file.read_bytes()
    for share in SHARES:
        file.write_bytes(content[: int(share * len(content))])
        with pytest.raises(ValueError, match=f'this repairs it: {repair}') as caught:
            read_of(tmp_path / 'a')
        assert '\n' not in str(caught.value)


@pytest.mark.parametrize('column', ['data = 5', "timestamp = 'text'"])
def test_a_database_with_other_types_in_a_row_is_damaged(tmp_path, column):
    path = tmp_path / 'a.db3'
    write_recording(path, [rows(100, truth=False)], 380.0, NAMES)
    with contextlib.closing(sqlite3.connect(path)) as database, database:
        database.execute(f'UPDATE messages SET {column} WHERE id = 50')
    with pytest.raises(ValueError, match=r'a message has no bytes or no time.*\.recover'):
        read_of(path)


def test_a_bag_of_ros_1_that_is_cut_off_says_what_repairs_it(tmp_path):
    path = tmp_path / 'a.bag'
    write_ros_1(path, rows(300))
    path.write_bytes(path.read_bytes()[:20_000])
    with pytest.raises(ValueError, match=r'a\.bag is damaged .*: rosbag reindex a\.bag'):
        open_recording(path)


def test_labels_after_the_damage_are_no_error(tmp_path):
    _, file = write_bag(tmp_path / 'a', StoragePlugin.MCAP)
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    (tmp_path / 'a' / 'a.labels.yaml').write_text('slip_s: [[1.0, 1.5], [9.0, 9.5]]')
    read, damage = read_of(file)
    assert damage
    assert 180 < read.truth.sum() < 200


def test_where_a_definition_is_broken_that_of_ros_is_used_and_an_unknown_type_is_named():
    assert JOINT_STATE in typestore_of(Topic('/a', JOINT_STATE, 'MSG', 'no [type')).types
    with pytest.raises(ValueError, match=r'definition of skin/msg/Tactile cannot be read'):
        typestore_of(Topic('/a', 'skin/msg/Tactile', 'MSG', 'no [type'))
    with pytest.raises(ValueError, match=r'does not define the type skin/msg/Tactile of /a'):
        typestore_of(Topic('/a', 'skin/msg/Tactile', 'NONE', ''))
