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

"""Damaged MCAP: every message that is whole is read, and none that is not."""

import functools
import re
import struct
import zlib

import lz4.frame
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip('rosbags', reason='needs rosbags')

from rosbags.rosbag2 import CompressionMode, StoragePlugin

from slip_detector.recordings.compression import zstd
from slip_detector.recordings.damaged_mcap import DamagedMcap
from slip_detector.recordings.topics import Topic
from support.damaged_bags import read_of, write_bag

MAGIC = b'\x89MCAP0\r\n'
SCHEMA, CHANNEL, MESSAGE, CHUNK, DATA_END = 3, 4, 5, 6, 15
TOPICS = {
    1: Topic('/voltages', 'a/msg/A', 'ros2msg', 'float64 a'),
    2: Topic('/b', 'b/msg/B', 'ros2idl', 'struct B'),
}
MESSAGES = [(1 + (k % 3 == 2), 100 + k, bytes([k]) * (k % 5)) for k in range(12)]
WANTED = [(TOPICS[key].name, at, raw) for key, at, raw in MESSAGES]


def record(kind, content):
    return struct.pack('<BQ', kind, len(content)) + content


def text(value):
    return struct.pack('<I', len(value)) + value.encode()


def definitions():
    parts = []
    for key, topic in TOPICS.items():
        schema = struct.pack('<H', key) + text(topic.msgtype) + text(topic.encoding)
        parts.append(record(SCHEMA, schema + text(topic.definition)))
        channel = struct.pack('<HH', key, key) + text(topic.name) + text('cdr')
        parts.append(record(CHANNEL, channel + struct.pack('<I', 0)))
    return b''.join(parts)


def message(key, at, raw):
    return record(MESSAGE, struct.pack('<HIQQ', key, 0, at, at) + raw)


def chunk(content, compression='', checksum=None):
    pack = {'': bytes, 'lz4': lz4.frame.compress, 'zstd': lambda data: zstd().compress(data)}
    packed = pack[compression](content)
    checksum = zlib.crc32(content) if checksum is None else checksum
    head = struct.pack('<QQQI', 100, 111, len(content), checksum) + text(compression)
    return record(CHUNK, head + struct.pack('<Q', len(packed)) + packed)


def mcap(path, *parts):
    path.write_bytes(MAGIC + b''.join(parts))
    return DamagedMcap(path, 'a.mcap')


def read(damaged, *names):
    return list(damaged.messages(set(names or ('/voltages', '/b'))))


@pytest.mark.parametrize('chunked', [False, True])
def test_wherever_a_file_is_cut_the_messages_before_are_read(tmp_path, chunked):
    messages = [message(*one) for one in MESSAGES]
    head = definitions()
    content = [b''.join(messages)]
    begin = len(MAGIC) + len(head)
    if chunked:
        content = [chunk(b''.join(messages[:6])), chunk(b''.join(messages[6:]))]
    whole = MAGIC + head + b''.join(content) + record(DATA_END, bytes(4))
    # Where each message ends in the file.
    ends = [whole.index(one, begin) + len(one) for one in messages]
    for size in range(begin, len(whole)):
        (tmp_path / 'cut.mcap').write_bytes(whole[:size])
        damaged = DamagedMcap(tmp_path / 'cut.mcap', 'a.mcap')
        assert damaged.topics == list(TOPICS.values())
        assert read(damaged) == [one for one, end in zip(WANTED, ends, strict=True) if end <= size]
        assert damaged.lost == f'is cut off at byte {size}'
    damaged = mcap(tmp_path / 'whole.mcap', whole[len(MAGIC) :])
    assert read(damaged) == WANTED
    assert not damaged.lost


@functools.cache
def compressed_messages(compression):
    """Return messages, and a chunk of them that is packed once for all examples."""
    random = np.random.default_rng(0).integers(0, 16, (4000, 100), dtype=np.uint8)
    messages = [(1, 100 + k, row.tobytes()) for k, row in enumerate(random)]
    return messages, chunk(b''.join(message(*one) for one in messages), compression)


@pytest.mark.parametrize('compression', ['lz4', 'zstd'])
@given(share=st.floats(0.0, 1.0))
def test_a_compressed_chunk_that_is_cut_gives_a_beginning(tmp_path_factory, compression, share):
    messages, packed = compressed_messages(compression)
    path = tmp_path_factory.mktemp('cut') / 'a.mcap'
    damaged = mcap(path, definitions(), packed[: int(share * len(packed))])
    got = read(damaged)
    assert got == [('/voltages', at, raw) for _, at, raw in messages[: len(got)]]
    # A block of either compression is at most 256 kB long.
    assert len(got) * 131 >= share * 4000 * 131 - 300_000
    assert bool(damaged.lost) or share == 1.0


def test_only_the_topics_that_are_asked_for_are_read(tmp_path):
    damaged = mcap(tmp_path / 'a.mcap', definitions(), *[message(*one) for one in MESSAGES])
    assert read(damaged, '/b') == [one for one in WANTED if one[0] == '/b']


@pytest.mark.parametrize('compression', ['', 'lz4', 'zstd'])
def test_a_chunk_with_a_wrong_checksum_is_left_out_and_no_other(tmp_path, compression):
    thirds = [b''.join(message(*one) for one in MESSAGES[k : k + 4]) for k in (0, 4, 8)]
    before, after = chunk(thirds[0], compression), chunk(thirds[2], compression)
    wrong = chunk(thirds[1], compression, checksum=12345)
    end = record(DATA_END, bytes(4))
    damaged = mcap(tmp_path / 'a.mcap', definitions(), before, wrong, after, end)
    assert read(damaged) == WANTED[:4] + WANTED[8:]
    begin = len(MAGIC) + len(definitions()) + len(before)
    assert damaged.lost == f'is damaged at byte {begin} of {(tmp_path / "a.mcap").stat().st_size}'


def test_a_chunk_without_a_checksum_is_taken_as_it_is(tmp_path):
    content = b''.join(message(*one) for one in MESSAGES)
    damaged = mcap(tmp_path / 'a.mcap', definitions(), chunk(content, 'zstd', checksum=0))
    assert read(damaged) == WANTED


def test_what_is_no_mcap_is_refused(tmp_path):
    (tmp_path / 'a.mcap').write_bytes(b'SQLite format 3')
    with pytest.raises(ValueError, match=r'b\.mcap: is broken or not mcap'):
        DamagedMcap(tmp_path / 'a.mcap', 'b.mcap')


@pytest.mark.parametrize('end', [None, -30])
def test_a_damaged_chunk_costs_no_other(tmp_path, end):
    written, file = write_bag(tmp_path / 'a', StoragePlugin.MCAP, CompressionMode.STORAGE, 30000)
    content = bytearray(file.read_bytes())
    pattern = b'zstd.{8}' + re.escape(bytes.fromhex('28b52ffd'))
    frames = [match.start() for match in re.finditer(pattern, content, re.DOTALL)]
    assert len(frames) > 2
    content[frames[1] + 12] ^= 1  # The second chunk is no zstd any more.
    file.write_bytes(content[:end])
    rows, lost = read_of(file)
    assert f'{file.name} is damaged at byte ' in lost
    assert 15000 < len(rows.volts) < 30000
    assert set(rows.stamps_ns.tolist()) <= set(written.stamps_ns.tolist())
    assert rows.stamps_ns[-1] == written.stamps_ns[-1]
