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

import re
import sqlite3
import sys

import numpy as np
import pytest

pytest.importorskip('rosbags', reason='needs rosbags')

from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2.storage_mcap import zstd

from slip_detector.recordings import open_recording
from slip_detector.recordings.bag_storage import make_typestore
from slip_detector.recordings.mcap import Topic
from support.bags import JOINT_STATE, NAMES, PLUGINS, Bag, check_same, gathered, rows, save

COMPRESSED = [
    *((plugin, CompressionMode.MESSAGE) for plugin in PLUGINS),
    (StoragePlugin.MCAP, CompressionMode.STORAGE),
]


def read_of(path):
    """Return the readable rows, and the one-line message about the rest."""
    recording = open_recording(path)
    read = gathered(recording)
    assert '\n' not in recording.counts.damage
    return read, recording.counts.damage


@pytest.mark.parametrize(('plugin', 'mode'), COMPRESSED)
def test_bags_that_the_recorder_compressed_are_read(tmp_path, plugin, mode):
    written, bag = rows(200), Bag(tmp_path / 'a', plugin)
    bag.writer.set_compression(mode, CompressionFormat.ZSTD)
    with bag:
        bag.write_rows(written)
    check_same(gathered(open_recording(tmp_path / 'a')), written)


def test_a_bag_whose_file_was_compressed_is_refused_with_the_command_that_unpacks_it(tmp_path):
    bag = Bag(tmp_path / 'a')
    bag.writer.set_compression(CompressionMode.FILE, CompressionFormat.ZSTD)
    with bag:
        bag.write_rows(rows(20))
    said = rf'a: has a\.mcap\.zstd, allowed: unpacked files, zstd -d {tmp_path}/a/\*\.zstd'
    with pytest.raises(ValueError, match=said):
        open_recording(tmp_path / 'a')
    # The command leaves the compressed file, and metadata that lists it.
    packed = tmp_path / 'a' / 'a.mcap.zstd'
    packed.with_suffix('').write_bytes(zstd.decompress(packed.read_bytes()))
    read, damage = read_of(tmp_path / 'a')
    check_same(read, rows(20))
    assert not damage


def split_bag(folder, numbers, ending):
    """Write a bag of several files with 300 rows each; return all rows and its folder."""
    written = rows(300 * len(numbers))
    for k, number in enumerate(numbers):
        part = written.take(slice(300 * k, 300 * (k + 1)))
        save(folder / f'split_{number}{ending}', part)
    return written, folder


@pytest.mark.parametrize('ending', ['.mcap', '.db3'])
def test_a_bag_that_was_split_into_files_is_one_recording(tmp_path, ending):
    # More than nine files: their numbers count, not their letters.
    written, folder = split_bag(tmp_path / 'split', (8, 9, 10), ending)
    check_same(gathered(open_recording(folder / f'split_8{ending}')), written.take(slice(300)))
    (folder / 'metadata.yaml').write_text('rosbag2_bagfile_information: {}')  # damaged
    check_same(gathered(open_recording(folder)), written)
    (folder / 'metadata.yaml').unlink()
    check_same(gathered(open_recording(folder)), written)


def test_without_rosbags_npz_is_read_and_a_bag_says_what_to_install(tmp_path, monkeypatch):
    for ending in ('.mcap', '.npz'):
        save(tmp_path / f'a{ending}', rows(20))
    monkeypatch.setitem(sys.modules, 'rosbags', None)
    check_same(gathered(open_recording(tmp_path / 'a.npz')), rows(20))
    with pytest.raises(ValueError, match=r'a\.mcap: bags need the package rosbags: pip install r'):
        open_recording(tmp_path / 'a.mcap')


def test_an_mcap_is_read_up_to_a_damaged_chunk_or_summary(tmp_path):
    written = rows(900)
    path = save(tmp_path / 'a.mcap', written)  # in chunks of a second, 380 rows
    content = path.read_bytes()
    summary = content.rindex(b'\x0f\4' + bytes(11))
    path.write_bytes(content[:summary] + bytes(len(content) - summary))
    read, damage = read_of(path)
    check_same(read, written)
    assert 'a.mcap is damaged at byte ' in damage
    place = content.index(written.volts[450].tobytes())
    # Over the head of the next message.
    path.write_bytes(content[:place] + b'\xff' * 99 + content[place + 99 :])
    # Labels after the damage are no error.
    (tmp_path / 'a.labels.yaml').write_text('slip_s: [[0.5, 1.0], [2.0, 2.1]]')
    read, damage = read_of(path)
    np.testing.assert_array_equal(read.volts, written.volts[:380])
    assert read.truth.sum() == 190
    assert re.fullmatch(r'a\.mcap has a damaged chunk at byte \d+: 380 samples up to .*', damage)


def test_without_checksums_a_record_that_is_longer_than_its_chunk_is_seen(tmp_path):
    with Bag(tmp_path / 'b') as bag:
        bag.write_rows(rows(20))
    path = tmp_path / 'b' / 'b.mcap'
    check_same(gathered(open_recording(path)), rows(20))
    path.write_bytes(path.read_bytes().replace(b'\5r\0\0\0\0', b'\5r\0\0\0\1', 1))
    with pytest.raises(ValueError, match=r'b\.mcap has a damaged chunk at byte \d+'):
        open_recording(path)


@pytest.mark.parametrize('ending', ['.db3', '.bag'])
@pytest.mark.parametrize('tail', [0, 100_000])
def test_a_database_or_bag_of_ros_1_is_read_up_to_where_it_is_lost_or_zero(tmp_path, ending, tail):
    written, path = rows(900), tmp_path / f'a{ending}'
    if ending == '.bag':
        with Bag(path) as bag:
            bag.write_rows(written, '/left')
    else:
        save(path, written)
    whole, content = open_recording(path), path.read_bytes()
    assert whole.channel_names == NAMES
    check_same(gathered(whole), written)
    for share in np.linspace(0.0, 1.0, 9)[:-1]:
        path.write_bytes(content[: int(share * len(content))] + bytes(tail))
        if ending == '.bag' or share < 0.2:
            with pytest.raises(ValueError, match=r'a\.\w+: is (damaged|cut off)'):
                open_recording(path)
            continue
        read, damage = read_of(path)
        check_same(read, written.take(slice(len(read.volts))))
        assert re.search(rf': {len(read.volts)} samples up to', damage)
        # The other bytes are indexes.
        assert len(read.volts) >= share * 900 - 170


def test_where_the_metadata_lists_other_files_or_messages_than_there_are_a_line_says_so(tmp_path):
    written, folder = split_bag(tmp_path / 'split', (0, 1, 2), '.mcap')
    listed = 'rosbag2_bagfile_information: {relative_file_paths: [split_0.mcap, split_3.mcap]}'
    (folder / 'metadata.yaml').write_text(listed)
    read, damage = read_of(folder)
    check_same(read, written)
    there = 'there are split_0.mcap, split_1.mcap, split_2.mcap'
    said = f'metadata.yaml lists split_0.mcap, split_3.mcap, {there}: ros2 bag reindex {folder}'
    assert damage.startswith(f'{said} lists all: 900 samples up to')
    listed = 'relative_file_paths: [split_0.mcap, split_1.mcap, split_2.mcap]'
    counted = f'rosbag2_bagfile_information: {{{listed}, message_count: 1000000}}'
    (folder / 'metadata.yaml').write_text(counted)
    assert read_of(folder)[1].startswith('metadata.yaml counts 1000000 messages, there are ')
    for broken, why in (('[', 'line 1'), ('rosbag2_bagfile_information: [1]', "'list' object")):
        (folder / 'metadata.yaml').write_text(broken)
        said = rf'metadata\.yaml is broken \({why}.*\): ros2 bag reindex mends it'
        with pytest.raises(ValueError, match=said):
            open_recording(folder)
    (folder / 'metadata.yaml').unlink()
    save(folder / 'other.mcap', written)
    with pytest.raises(ValueError, match=r'has files of several bags: other\.mcap, split_0\.mcap'):
        open_recording(folder)


def test_what_is_beside_a_database_or_not_in_its_table_of_topics_is_named(tmp_path):
    path = save(tmp_path / 'a.db3', rows(60, truth=False))
    (tmp_path / 'a.db3-wal').write_bytes(b'rows')
    read, damage = read_of(path)
    assert damage.startswith('a.db3-wal beside it is not read: sqlite3 ')
    check_same(read, rows(60, truth=False))
    database = sqlite3.connect(path)
    database.execute('DELETE FROM topics')
    database.commit()
    database.close()
    with pytest.raises(ValueError, match=r'a\.db3: is damaged, or has a message of no topic'):
        open_recording(path)


def test_where_a_definition_is_broken_that_of_ros_is_used_and_an_unknown_type_is_named():
    assert JOINT_STATE in make_typestore(Topic('/a', JOINT_STATE, 'ros2msg', 'no [type')).types
    for encoding in ('ros2msg', 'ros2idl', ''):
        with pytest.raises(ValueError, match=r'/a is skin/msg/Tactile, of which the bag has no d'):
            make_typestore(Topic('/a', 'skin/msg/Tactile', encoding, 'no [type'))
