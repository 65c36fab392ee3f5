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

"""Reads the messages of MCAP files from the front, up to any damage."""

import io
import os
import struct
import zlib
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import IO, NamedTuple

#: The first and the last bytes of an MCAP.
MAGIC = b'\x89MCAP0\r\n'

#: A record begins with its kind and its length in bytes; 1 to 15 are kinds of the format, 128 to
#: 255 those of applications.
_RECORD = struct.Struct('<BQ')
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _STATISTICS = 2, 3, 4, 5, 6, 11
_KINDS, _IN_CHUNK = (*range(1, 16), *range(128, 256)), (_SCHEMA, _CHANNEL, _MESSAGE)
_READ = (*_IN_CHUNK, _CHUNK, _STATISTICS, _FOOTER)

#: A message begins with its channel, number, time of receipt and time of publishing; a chunk with
#: its first and last time, its length, its checksum (0: none) and the length of what follows, the
#: name of its compression.
_MESSAGE_HEAD, _CHUNK_HEAD = struct.Struct('<HIQQ'), struct.Struct('<QQQII')

#: How much of the end of a file is read at a time to find its last byte that is not zero.
_TAIL_BYTES = 2**20

#: What is said of messages outside of a chunk, or in a chunk without a checksum.
UNCHECKED = 'without checksums, so that damage may go unseen'

#: Number of a topic in its file, time of receipt in nanoseconds, serialised message.
Received = tuple[int, int, bytes]

#: Kind and content of each record, and where the last one ends.
Records = Generator[tuple[int, bytes], None, int]


class Topic(NamedTuple):
    """A topic of a bag: its name, and name, format (as ros2msg) and definition of its type."""

    name: str
    msgtype: str
    encoding: str
    definition: str


class DamageError(ValueError):
    """Damage to a file, of which all before it was read."""


class BagFile:
    """A file of a bag.

    Attributes
    ----------
    path : Path
    topics : dict
        The topics that were found so far, by their numbers.
    doubts : str
        Why damage to what was read so far may go unseen; empty if it cannot.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.doubts = path, ''
        self.topics: dict[int, Topic] = {}


def messages_of(file: BagFile) -> Iterator[Received]:
    """Yield the messages of all topics of an MCAP in the order of the file.

    Indexes are not read, and neither are the times in records on chunks.

    Raises
    ------
    DamageError
        At damage; says where. Damage within a record may raise anything.
    """
    schemas: dict[int, list[str]] = {}
    n = 0
    with open(file.path, 'rb') as data:
        if data.read(len(MAGIC)) != MAGIC:
            raise DamageError('is damaged at byte 0, or no MCAP')
        size = _size(data)
        for kind, record in _records(file, data, len(MAGIC), size):
            number = int.from_bytes(record[:2], 'little')
            if kind == _MESSAGE:
                n += 1
                yield number, _MESSAGE_HEAD.unpack_from(record)[2], record[_MESSAGE_HEAD.size :]
            elif kind == _SCHEMA:
                schemas[number] = _texts(record[2:], 3)
            elif kind == _CHANNEL:
                described = schemas.get(int.from_bytes(record[2:4], 'little'), ['', '', ''])
                file.topics.setdefault(number, Topic(*_texts(record[4:], 1), *described))
            elif kind == _STATISTICS and n != (said := int.from_bytes(record[:8], 'little')):
                raise DamageError(f'has {n} messages, and counts {said} in its summary')
            elif kind == _FOOTER:
                return
        raise DamageError(f'is cut off at byte {size}')


def _size(data: IO[bytes]) -> int:
    """Return the length of a file without the zeros at its end that a power cut leaves."""
    size = end = data.seek(0, os.SEEK_END)
    content = b''
    while end and not content:
        begin = data.seek(max(0, end - _TAIL_BYTES))
        content, end = data.read(end - begin).rstrip(b'\0'), begin
    # The lengths of two empty lists, with which a JointState ends, are zeros of its own.
    return min(size, end + len(content) + 8)


def _records(file: BagFile, data: IO[bytes], begin: int, size: int, chunk: int = 0) -> Records:
    """Yield kind and content of each whole record; those of a chunk, which may be cut off, too.

    ``chunk`` is the first byte of the chunk that has the records; 0: they are in none. Return
    where the last record ends.
    """
    while begin + _RECORD.size <= size:
        data.seek(begin)
        kind, length = _RECORD.unpack(data.read(_RECORD.size))
        if kind not in (_IN_CHUNK if chunk else _KINDS):
            raise DamageError(f'is damaged at byte {chunk or begin}')
        place, begin = begin, begin + _RECORD.size + length
        content = data.read(min(begin, size) - data.tell()) if kind in _READ else b''
        if kind == _CHUNK:
            raw = _unpacked(file, content, place, begin <= size)
            end = yield from _records(file, io.BytesIO(raw), 0, len(raw), place)
            if begin <= size and end != len(raw):
                raise DamageError(f'has a damaged chunk at byte {place}')
        elif begin <= size:
            if kind == _MESSAGE and not chunk:
                file.doubts = UNCHECKED
            yield kind, content
    return begin


def _unpacked(file: BagFile, content: bytes, begin: int, whole: bool) -> bytes:
    """Return the records of a chunk; of one that is cut off what is there, if it can be read."""
    from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

    *_, size, checksum, n = _CHUNK_HEAD.unpack_from(content.ljust(_CHUNK_HEAD.size, b'\0'))
    compression = content[_CHUNK_HEAD.size : _CHUNK_HEAD.size + n].decode()
    content = content[_CHUNK_HEAD.size + n + 8 :]  # Behind the length when compressed.
    if compression:
        content = DECOMPRESSORS[compression](content, size) if whole else b''
    is_same = len(content) == size and (not checksum or zlib.crc32(content) == checksum)
    if whole and not is_same:
        raise DamageError(f'has a damaged chunk at byte {begin}')
    if not checksum:
        file.doubts = UNCHECKED
    return content


def _texts(content: bytes, n: int) -> list[str]:
    """Return the texts at the beginning of a record, each after its length."""
    data = io.BytesIO(content)
    return [data.read(int.from_bytes(data.read(4), 'little')).decode() for _ in range(n)]
