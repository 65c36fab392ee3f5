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

"""The chunks of MCAP files: their checksums are written, and missed where there are none."""

import struct
import zlib

import numpy as np
import pytest

pytest.importorskip('rosbags', reason='needs rosbags')

from slip_detector.recordings import open_recording, write_recording
from slip_detector.recordings.mcap_chunks import chunks_of, survey, write_checksums
from slip_detector.recordings.reading_limit import ReadingLimit
from support.bags import NAMES, gathered, rows
from support.damaged_bags import read_of

#: Of a whole file of this many rows each 37th byte is damaged.
ROWS = 60


@pytest.fixture
def path(tmp_path):
    path = tmp_path / 'a.mcap'
    write_recording(path, [rows(ROWS)], 380.0, NAMES)
    return path


def take_checksums(path):
    """Make a file as rosbags and fast recorders write it."""
    content = bytearray(path.read_bytes())
    for chunk in chunks_of(path):
        content[chunk.begin + 24 : chunk.begin + 28] = bytes(4)
    path.write_bytes(content)


def test_a_recording_is_written_with_the_checksum_of_each_chunk(path):
    content = path.read_bytes()
    chunks = list(chunks_of(path))
    assert chunks
    for begin, length, size, checksum in chunks:
        assert size == length - 40
        assert checksum == zlib.crc32(content[begin + 40 : begin + length])
    assert survey(path, ReadingLimit(path, 1.0)) == ''
    assert read_of(path)[1] == ''
    before = path.read_bytes()
    write_checksums(path)
    assert path.read_bytes() == before


# The metadata of a folder take longer to read than all of the file.
@pytest.mark.parametrize(('in_folder', 'step'), [(True, 113), (False, 37)])
def test_no_damage_to_a_recording_changes_rows_unseen(tmp_path, in_folder, step):
    path = tmp_path / ('a' if in_folder else 'a.mcap')
    written = rows(ROWS)
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


def test_a_file_without_checksums_is_said_to_have_none(path):
    take_checksums(path)
    recording = open_recording(path)
    assert len(gathered(recording).volts) == ROWS
    assert recording.counts.warnings == ('a.mcap has no checksums, so that damage may go unseen')


def test_messages_outside_of_chunks_have_no_checksum(path):
    whole = path.read_bytes()
    (chunk,) = chunks_of(path)
    before = chunk.begin - 9  # where the head of its record begins
    content = whole[chunk.begin + 40 : chunk.begin + chunk.length]
    path.write_bytes(whole[:before] + content + whole[chunk.begin + chunk.length :])
    recording = open_recording(path)
    assert len(gathered(recording).volts) == ROWS
    said = 'a.mcap has no checksums of messages outside of chunks, so that damage may go unseen'
    assert recording.counts.warnings == said


def test_some_chunks_without_a_checksum_are_counted(tmp_path):
    def chunk(checksum):
        content = struct.pack('<QQQI', 0, 0, 0, checksum) + bytes(12)
        return struct.pack('<BQ', 6, len(content)) + content

    path = tmp_path / 'a.mcap'
    path.write_bytes(b'\x89MCAP0\r\n' + chunk(0) + chunk(7) + chunk(0) + chunk(8)[:-13])
    assert [one.checksum for one in chunks_of(path)] == [0, 7, 0]
    assert survey(path, ReadingLimit(path, 1.0)).startswith('has no checksums in 2 of 3 chunks,')
