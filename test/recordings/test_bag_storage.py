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

"""The messages of a bag: whole, compressed, split, cut off, or none at all."""

import contextlib
import functools
import shutil
import sqlite3
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip('rosbags', reason='needs rosbags')

from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin

from slip_detector.recordings import ENDINGS, open_recording, write_recording
from support.bags import (
    JOINT_STATE,
    NAMES,
    PLUGINS,
    START_NS,
    Bag,
    check_same,
    gathered,
    rows,
)
from support.damaged_bags import MESSAGES, check_is_beginning, read_of, write_bag


@pytest.mark.parametrize('mode', [CompressionMode.FILE, CompressionMode.MESSAGE])
@pytest.mark.parametrize('plugin', PLUGINS)
def test_bags_that_the_recorder_compressed_are_read(tmp_path, plugin, mode):
    written = rows(200, truth=False)
    bag = Bag(tmp_path / 'a', plugin)
    bag.writer.set_compression(mode, CompressionFormat.ZSTD)
    with bag:
        for stamp_ns, row in zip(written.stamps_ns, written.volts, strict=True):
            bag.write('/voltages', bag.joints(stamp_ns, row), stamp_ns)
    check_same(gathered(open_recording(tmp_path / 'a')), written)


def test_a_compressed_mcap_is_read(tmp_path):
    written = rows(200, truth=False)
    bag = Bag(tmp_path / 'a')
    bag.writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with bag:
        for stamp_ns, row in zip(written.stamps_ns, written.volts, strict=True):
            bag.write('/voltages', bag.joints(stamp_ns, row), stamp_ns)
    check_same(gathered(open_recording(tmp_path / 'a')), written)


@pytest.mark.parametrize('ending', ['.mcap', '.db3'])
def test_a_bag_that_was_split_into_files_is_one_recording(tmp_path, ending):
    written = rows(900)
    folder = tmp_path / 'split'
    folder.mkdir()
    files = []
    for k in range(3):
        part = written.take(slice(300 * k, 300 * (k + 1)))
        # More than nine files: their numbers count, not their letters.
        files.append(f'split_{k + 8}{ending}')
        write_recording(folder / files[-1], [part], 380.0, NAMES)
    topics = '\n'.join(
        f'    - message_count: {count}\n      topic_metadata: {{name: {name}, type: {msgtype}, '
        'serialization_format: cdr, offered_qos_profiles: ""}'
        for name, msgtype, count in (
            ('/voltages', JOINT_STATE, 900),
            ('/slip_truth', 'std_msgs/msg/Bool', 11),
        )
    )
    (folder / 'metadata.yaml').write_text(f"""rosbag2_bagfile_information:
  version: 5
  storage_identifier: {'mcap' if ending == '.mcap' else 'sqlite3'}
  relative_file_paths: [{', '.join(files)}]
  duration: {{nanoseconds: 2000000000}}
  starting_time: {{nanoseconds_since_epoch: {START_NS}}}
  message_count: 911
  compression_format: ""
  compression_mode: ""
  topics_with_message_count:
{topics}
""")
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
    done = subprocess.run(
        [sys.executable, '-c', code, str(tmp_path / 'a')],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    said = f'{tmp_path / "a.mcap"}: bags need the package rosbags: pip install rosbags'
    assert done.stdout.splitlines() == ['20', said]


@pytest.fixture(scope='module')
def whole_bag(tmp_path_factory):
    """Write a bag of each kind once; tests cut copies of it."""
    return functools.cache(
        lambda plugin, mode: write_bag(tmp_path_factory.mktemp('whole') / 'a', plugin, mode)
    )


#: Of a file, up to which it is there.
SHARES = np.linspace(0.0, 1.0, 13)[:-1]


@pytest.mark.parametrize('in_folder', [True, False])
@pytest.mark.parametrize(
    ('plugin', 'mode'),
    [
        (StoragePlugin.MCAP, CompressionMode.NONE),
        (StoragePlugin.MCAP, CompressionMode.STORAGE),
        (StoragePlugin.SQLITE3, CompressionMode.NONE),
    ],
)
def test_wherever_a_bag_is_cut_its_beginning_is_read(tmp_path, whole_bag, plugin, mode, in_folder):
    written, whole = whole_bag(plugin, mode)
    shutil.copytree(whole.parent, tmp_path / 'a')
    file = tmp_path / 'a' / whole.name
    content = whole.read_bytes()
    path = file.parent if in_folder else file
    if not in_folder:
        path = tmp_path / file.name
    counts = []
    for share in SHARES:
        cut = path if path.is_file() or not in_folder else file
        cut.write_bytes(content[: int(share * len(content))])
        try:
            read, lost = read_of(path)
        except ValueError as error:
            said = str(error)
            # Not even the definitions are there, or no sample is.
            assert share < 0.2, said
            assert said.startswith(f'{path}: ')
            assert '\n' not in said
            counts.append(0)
            continue
        check_is_beginning(read, written)
        counts.append(len(read.volts))
        if len(read.volts) < MESSAGES:
            assert file.name in lost
            assert f'/voltages is lost, {len(read.volts)} messages up to' in lost
            if in_folder:
                assert f'{MESSAGES - len(read.volts)} of {MESSAGES} messages' in lost
    assert counts == sorted(counts)
    # Little more is lost than what is not there.
    for share, count in zip(SHARES, counts, strict=True):
        assert count >= (share - 0.25) * MESSAGES
    assert counts[-1] > 0.7 * MESSAGES


@pytest.mark.parametrize('plugin', PLUGINS)
@pytest.mark.parametrize('mode', [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_what_the_recorder_compressed_may_be_cut_too(tmp_path, plugin, mode):
    written, file = write_bag(tmp_path / 'a', plugin, mode)
    content = file.read_bytes()
    file.write_bytes(content[: len(content) * 2 // 3])
    read, lost = read_of(tmp_path / 'a')
    check_is_beginning(read, written)
    assert MESSAGES * 0.3 < len(read.volts) < MESSAGES
    assert f'{MESSAGES - len(read.volts)} of {MESSAGES} messages on /voltages is lost' in lost


@pytest.mark.parametrize('plugin', PLUGINS)
def test_a_file_that_is_taken_out_of_a_bag_whose_recorder_died_is_read(tmp_path, plugin):
    written, file = write_bag(tmp_path / 'a', plugin, n=200)
    (file.parent / 'metadata.yaml').unlink()
    for path in (file, file.parent):
        read, lost = read_of(path)
        check_is_beginning(read, written)
        assert len(read.volts) == 200
        assert not lost


def test_labels_after_the_loss_are_not_held_against_the_person(tmp_path):
    _, file = write_bag(tmp_path / 'a', StoragePlugin.MCAP)
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    (tmp_path / 'a' / 'a.labels.yaml').write_text('slip_s: [[1.0, 1.5], [9.0, 9.5]]')
    read, lost = read_of(file)
    assert lost
    assert 180 < read.truth.sum() < 200


@pytest.fixture(scope='module')
def content_of(tmp_path_factory):
    """Write a recording of each ending once; return its bytes."""

    def written(ending):
        path = tmp_path_factory.mktemp('whole') / f'a{ending}'
        write_recording(path, [rows(40)], 380.0, NAMES)
        return path.read_bytes()

    return functools.cache(written)


@pytest.mark.parametrize('ending', ENDINGS)
@given(data=st.data())
def test_no_bytes_end_in_anything_but_rows_or_one_line(tmp_path_factory, content_of, ending, data):
    folder = tmp_path_factory.mktemp('fuzz')
    path = folder / f'a{ending}'
    content = bytearray(content_of(ending))
    kind = data.draw(st.sampled_from(['noise', 'cut', 'flipped', 'other ending', 'zeros']))
    if kind == 'noise':
        content = bytearray(data.draw(st.binary(max_size=200)))
    elif kind == 'cut':
        content = content[: data.draw(st.integers(0, len(content)))]
    elif kind == 'flipped':
        for place in data.draw(st.lists(st.integers(0, len(content) - 1), max_size=5)):
            content[place] ^= data.draw(st.integers(1, 255))
    elif kind == 'zeros':
        begin = data.draw(st.integers(0, len(content)))
        content[begin : begin + 100] = bytes(100)
    else:
        path = folder / f'b{data.draw(st.sampled_from(ENDINGS))}'
    path.write_bytes(content)
    try:
        recording = open_recording(path)
        for piece in recording.pieces():
            assert len(piece.volts) == len(piece.stamps_ns) > 0
        assert '\n' not in recording.counts.damage
    except ValueError as error:
        said = str(error)
        assert said.startswith(f'{path}: ')
        assert '\n' not in said


@pytest.mark.parametrize('mode', [CompressionMode.FILE, CompressionMode.MESSAGE])
@pytest.mark.parametrize('plugin', PLUGINS)
def test_no_damage_to_a_folder_ends_in_anything_but_rows_or_one_line(tmp_path, plugin, mode):
    _, file = write_bag(tmp_path / 'a', plugin, mode, n=50)
    metadata = file.parent / 'metadata.yaml'
    random = np.random.default_rng(3)
    outcomes = set()
    for damaged in (file, metadata):
        content = damaged.read_bytes()
        for _ in range(60):
            broken = bytearray(content)
            for place in random.integers(0, len(broken), 4):
                broken[place] = random.integers(0, 256)
            damaged.write_bytes(broken)
            try:
                recording = open_recording(tmp_path / 'a')
                outcomes.add(sum(len(piece.volts) for piece in recording.pieces()))
                assert '\n' not in recording.counts.damage
            except ValueError as error:
                said = str(error)
                assert said.startswith(f'{tmp_path / "a"}: ')
                assert '\n' not in said
        damaged.write_bytes(content)
    assert 50 in outcomes


@pytest.mark.parametrize(
    'column', ["data = 'text'", 'data = 5', 'data = 5.5', "timestamp = 'text'", 'timestamp = 1e30']
)
def test_a_database_with_other_types_in_a_row_loses_that_row_only(tmp_path, column):
    path = tmp_path / 'a.db3'
    write_recording(path, [rows(100, truth=False)], 380.0, NAMES)
    with contextlib.closing(sqlite3.connect(path)) as database, database:
        database.execute(f'UPDATE messages SET {column} WHERE id = 50')
    read, lost = read_of(path)
    assert len(read.volts) == 100  # the gap is bridged
    assert '(a message has no bytes or no time): 1 of 100 messages on /voltages is lost' in lost
    with contextlib.closing(sqlite3.connect(path)) as database, database:
        database.execute(f'UPDATE messages SET {column}')
    with pytest.raises(ValueError, match=r'a\.db3: has no samples on /voltages'):
        open_recording(path)
