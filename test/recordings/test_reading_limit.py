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

"""Small files that stand for much: one line, before they take memory."""

import io
import sqlite3
import struct
import time
import zipfile

import numpy as np
import pytest

pytest.importorskip('rosbags', reason='needs rosbags')

import lz4.frame

from slip_detector.parameters.driver import RecordingConfig
from slip_detector.recordings import open_recording, write_recording
from slip_detector.recordings.compression import zstd
from slip_detector.recordings.reading_limit import PIECE_ROWS, ReadingLimit
from support.bags import ENDINGS, NAMES, Bag, gathered, rows
from support.little_memory import little_memory

#: Reading takes at most four times the limit.
SMALL = RecordingConfig(recording_limit_mb=20.0)
MEMORY = 4 * 20_000_000


@pytest.fixture(autouse=True, scope='module')
def _loaded(tmp_path_factory):
    """Load what reading needs, libraries and compiled code, before memory is short."""
    for ending in ENDINGS:
        path = tmp_path_factory.mktemp('loaded') / f'a{ending}'
        samples = rows(50)
        samples.stamps_ns[30:] += 20_000_000
        write_recording(path, [samples], 380.0, NAMES)
        gathered(open_recording(path))


def said(path, config=SMALL):
    """Return the one line that reading ends in, with little memory."""
    with little_memory(MEMORY), pytest.raises(ValueError, match=r'.') as caught:
        gathered(open_recording(path, config))
    assert str(caught.value).startswith(f'{path}: ')
    assert '\n' not in str(caught.value)
    return str(caught.value).removeprefix(f'{path}: ')


def test_a_long_header_of_an_array_is_not_read(tmp_path):
    path = npz(tmp_path / 'a.npz', sample_rate_hz=((), 8))
    with (
        zipfile.ZipFile(path, 'a', zipfile.ZIP_DEFLATED) as archive,
        archive.open('volts.npy', 'w', force_zip64=True) as file,
    ):
        file.write(b'\x93NUMPY\x02\x00' + (2**32 - 1).to_bytes(4, 'little'))
        for _ in range(100):
            file.write(bytes(1 << 20))
    assert said(path) == 'is broken or not npz (volts is no array)'


def npz(path, **members):
    """Write an npz of arrays, or of a shape and the zeros that follow it."""
    with zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as archive:
        for name, (shape, n_zeros) in members.items():
            head = io.BytesIO()
            np.lib.format.write_array_header_1_0(
                head, {'descr': '<f8', 'fortran_order': False, 'shape': shape}
            )
            with archive.open(f'{name}.npy', 'w', force_zip64=True) as file:
                file.write(head.getvalue())
                for _ in range(0, n_zeros, 1 << 20):
                    file.write(bytes(min(n_zeros, 1 << 20)))
    return path


@pytest.mark.parametrize(
    ('members', 'line'),
    [
        ({'volts': ((2, 10**9), 0)}, f'has {10**9} channels, allowed: 305 with 20 MB'),
        ({'volts': ((10**9, 10**9), 0)}, f'has {10**9} channels, allowed: 305 with 20 MB'),
        ({'slip': ((3, 10**9), 0)}, f'slip has the shape (3, {10**9}), allowed: (3,)'),
        ({'stamps_ns': ((3, 10**9), 0)}, f'stamps_ns has the shape (3, {10**9}), allowed: (3,)'),
        ({'sample_rate_hz': ((10**9,), 0)}, f'sample_rate_hz is {10**9} values, allowed: a rate'),
        ({'volts': ((10**6, 300), 100_000_000)}, 'slip has 3 rows, allowed: 1000000, as volts'),
    ],
)
def test_an_npz_that_declares_much_is_refused(tmp_path, members, line):
    path = npz(tmp_path / 'zeros.npz', **{'volts': ((3, 2), 48), 'slip': ((3,), 24), **members})
    # Zeros are no rate.
    np.savez(tmp_path / 'rate.npz', sample_rate_hz=380.0)
    with zipfile.ZipFile(path, 'a') as archive, zipfile.ZipFile(tmp_path / 'rate.npz') as rate:
        if 'sample_rate_hz' not in members:
            archive.writestr('sample_rate_hz.npy', rate.read('sample_rate_hz.npy'))
    assert said(path).startswith(line)


def test_an_array_that_is_asked_for_whole_is_within_the_limit(tmp_path):
    path = npz(tmp_path / 'a.npz', other=((2 * 10**7,), 16 * 10**7))
    np.savez(tmp_path / 'b.npz', volts=np.zeros((9, 3)), sample_rate_hz=380.0)
    with zipfile.ZipFile(path, 'a') as archive, zipfile.ZipFile(tmp_path / 'b.npz') as rest:
        for name in rest.namelist():
            archive.writestr(name, rest.read(name))
    with little_memory(MEMORY):
        recording = open_recording(path, SMALL)
        with pytest.raises(ValueError, match='other takes 160 MB, allowed: 20 MB'):
            recording.array('other')


def test_a_line_of_a_csv_without_end_is_refused(tmp_path):
    path = tmp_path / 'a.csv'
    for text in ('time_s,a\n0,1\n' + '0,' * 100_000, ',' * 100_000):
        path.write_text(text)
        assert 'has more than 19520 characters, allowed: fewer' in said(path)
    path.unlink()
    path.symlink_to('/dev/zero')
    assert said(path).startswith('line 1 has more than 19520 characters')
    path.unlink()
    path.write_text('time_s,' + ','.join(f'c{k}' for k in range(306)) + '\n')
    assert said(path).startswith('has 306 channels, allowed: 305')


def chunk(content, compression, size=None):
    pack = {'lz4': lz4.frame.compress, 'zstd': lambda data: zstd().compress(data)}[compression]
    packed = pack(content)
    head = struct.pack('<QQQI', 0, 1, len(content) if size is None else size, 0)
    name = compression.encode()
    body = head + struct.pack('<I', len(name)) + name + struct.pack('<Q', len(packed)) + packed
    return struct.pack('<BQ', 6, len(body)) + body


@pytest.mark.parametrize('compression', ['lz4', 'zstd'])
@pytest.mark.parametrize('size', [None, 1000])
def test_a_chunk_that_stands_for_much_is_refused_whatever_it_declares(tmp_path, compression, size):
    whole = tmp_path / 'whole.mcap'
    write_recording(whole, [rows(100)], 380.0, NAMES)
    content = whole.read_bytes()
    header = content[: 8 + 9 + struct.unpack_from('<Q', content, 9)[0]]
    path = tmp_path / 'a.mcap'
    path.write_bytes(
        header + chunk(bytes(500_000_000), compression, size) + content[len(header) :]
    )
    line = said(path) if size is None else ''
    if size is None:
        assert line.startswith('the chunk at byte ')
        assert line.endswith('takes 500 MB, allowed: 20 MB (recording_limit_mb)')
        return
    # What it declares is small: it is damage, and what else there is can be read.
    with little_memory(MEMORY):
        assert len(gathered(open_recording(path, SMALL)).volts) == 100


def test_a_record_that_is_longer_than_the_limit_is_refused(tmp_path):
    path = tmp_path / 'a.mcap'
    with open(path, 'wb') as file:
        file.write(b'\x89MCAP0\r\n' + struct.pack('<BQ', 5, 10**9))
        file.truncate(10**9 + 1000)  # takes no room on the disk
    assert said(path) == 'the record at byte 17 takes 1000 MB, allowed: 20 MB (recording_limit_mb)'


@pytest.mark.parametrize('ending', ['.mcap', '.db3'])
def test_a_file_that_the_recorder_compressed_does_not_fill_the_disk(tmp_path, ending):
    folder = tmp_path / 'a'
    write_recording(folder, [rows(10)], 380.0, NAMES)
    (folder / 'a.mcap').unlink()
    (folder / f'a{ending}.zstd').write_bytes(zstd().compress(bytes(10**8)))
    assert said(folder) == f'a{ending}.zstd decompresses to more than 100 times its size'


def test_a_message_that_is_larger_than_a_share_of_the_limit_is_refused(tmp_path):
    path = tmp_path / 'a.db3'
    write_recording(path, [rows(10, truth=False)], 380.0, NAMES)
    with sqlite3.connect(path) as database:
        database.execute('UPDATE messages SET data = zeroblob(2000000) WHERE id = 5')
    database.close()
    assert said(path) == (
        'a message on /voltages takes 2 MB, allowed: 1.25 MB (1/16 of recording_limit_mb)'
    )


def test_a_view_in_place_of_the_messages_is_refused(tmp_path):
    path = tmp_path / 'a.db3'
    write_recording(path, [rows(10, truth=False)], 380.0, NAMES)
    with sqlite3.connect(path) as database:
        database.execute('ALTER TABLE messages RENAME TO some')
        database.execute(
            'CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 '
            'FROM n) SELECT id, 1 AS topic_id, id AS timestamp, zeroblob(9) AS data FROM n'
        )
    database.close()
    assert said(path) == 'a.db3: is broken or not db3 (it has views)'


@pytest.mark.parametrize(
    ('definition', 'line'),
    [
        (
            '\n'.join(f'float64 field_{k}' for k in range(100_000)),
            r'characters, allowed: 200000\)',
        ),
        ('string[100000] a', 'a/msg/A.a has 100000 elements, allowed: 2000'),
        ('std_msgs/Empty[1000000000] a', 'a/msg/A.a has 1000000000 elements, allowed: 2000'),
    ],
)
def test_a_definition_that_is_too_large_is_not_compiled(definition, line):
    from slip_detector.recordings.topics import Topic, typestore_of

    empty = f'{definition}\n{"=" * 80}\nMSG: std_msgs/Empty\n'
    began_s = time.process_time()
    with pytest.raises(ValueError, match=line):
        typestore_of(Topic('/a', 'a/msg/A', 'ros2msg', empty))
    assert time.process_time() - began_s < 20.0


@pytest.mark.parametrize(
    'text', ['[' * 200_000, '- ' * 200_000, 'a: &a [*a]'], ids=['flow', 'block', 'alias']
)
def test_metadata_that_end_the_parser_of_rosbags_are_not_given_to_it(tmp_path, text):
    write_recording(tmp_path / 'a', [rows(10)], 380.0, NAMES)
    (tmp_path / 'a' / 'metadata.yaml').write_text(text)
    # A folder that lost its metadata is read from its files.
    with little_memory(MEMORY):
        assert len(gathered(open_recording(tmp_path / 'a', SMALL)).volts) == 10


def test_gaps_that_stand_for_many_rows_are_refused(tmp_path):
    path = tmp_path / 'a.npz'
    stamps_ns = np.arange(1000) * 90_000_000  # bridged up to 0.1 s
    np.savez(path, volts=np.zeros((1000, 16)), sample_rate_hz=1e6, stamps_ns=stamps_ns)
    assert 'what bridges the gaps takes' in said(path)


def test_what_is_within_the_limit_is_read(tmp_path):
    limit = ReadingLimit(tmp_path, 20.0)
    channels = limit.channels
    assert channels * PIECE_ROWS * 8 <= limit.most_bytes
    path = tmp_path / 'a.npz'
    np.savez(path, volts=np.zeros((2 * PIECE_ROWS, channels), np.float32), sample_rate_hz=380.0)
    with little_memory(MEMORY):
        n = sum(len(piece.volts) for piece in open_recording(path, SMALL).pieces())
    assert n == 2 * PIECE_ROWS
    with Bag(tmp_path / 'bag') as bag:
        for stamp_ns, row in zip(*reversed(rows(40)[:2]), strict=True):
            bag.write('/voltages', bag.joints(stamp_ns, row), stamp_ns)
    assert len(gathered(open_recording(tmp_path / 'bag', SMALL)).volts) == 40
