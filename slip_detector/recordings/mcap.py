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

"""MCAP files: their messages read from the front, up to any damage; written a second at a time."""

import importlib
import io
import os
import struct
import sys
import zlib
from collections.abc import Generator, Iterator
from pathlib import Path
from struct import pack
from typing import IO, Any, NamedTuple

#: The first and the last bytes of an MCAP.
MAGIC = b'\x89MCAP0\r\n'

#: The modules that unpack what rosbag2 compresses; they come with rosbags.
ZSTD = 'compression.zstd' if sys.version_info >= (3, 14) else 'backports.zstd'
MODULES = {'zstd': ZSTD, 'lz4': 'lz4.frame'}

#: Each record begins with its kind, one of those here, of the summary or of an application, and
#: its length in bytes.
_RECORD = struct.Struct('<BQ')
_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX, _CHUNK_INDEX = range(1, 9)
_STATISTICS, _DATA_END = 11, 15
_KINDS, _IN_CHUNK = (*range(1, 16), *range(128, 256)), (_SCHEMA, _CHANNEL, _MESSAGE)
_READ = (*_IN_CHUNK, _CHUNK, _STATISTICS, _FOOTER)

#: A message begins with its channel, number, time of receipt and time of publishing; a chunk with
#: its first and last time, its length, its checksum (0: none) and the length of what follows, the
#: name of its compression.
_MESSAGE_HEAD, _CHUNK_HEAD = struct.Struct('<HIQQ'), struct.Struct('<QQQII')

#: The next message after so much begins a new chunk. What is written as the length of one that
#: has not ended yet.
CHUNK_NS, CHUNK_BYTES, NEVER_ENDS = 1_000_000_000, 2**20, 2**62

#: Of messages outside of a chunk, or in one that has no checksum.
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
        begin = data.seek(max(0, end - CHUNK_BYTES))
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
    *_, size, checksum, n = _CHUNK_HEAD.unpack_from(content.ljust(_CHUNK_HEAD.size, b'\0'))
    compression = content[_CHUNK_HEAD.size : _CHUNK_HEAD.size + n].decode()
    content = content[_CHUNK_HEAD.size + n + 8 :]  # Behind the length when compressed.
    if compression:
        unpack = importlib.import_module(MODULES[compression]).decompress
        content = unpack(content) if whole else b''
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


def _sized(content: bytes) -> bytes:
    return pack('<I', len(content)) + content


def _joined(*parts: bytes | str) -> bytes:
    """Return the parts one behind the other, each text behind its length."""
    return b''.join(_sized(one.encode()) if isinstance(one, str) else one for one in parts)


def _chunk_head(size: int, span_ns: tuple[int, int] = (0, 0), checksum: int = 0) -> bytes:
    head = _CHUNK_HEAD.pack(*span_ns, size, checksum, 0) + pack('<Q', size)
    return _RECORD.pack(_CHUNK, len(head) + size) + head


def _record(kind: int, *parts: bytes | str) -> bytes:
    content = _joined(*parts)
    return _RECORD.pack(kind, len(content)) + content


class McapStorage:
    """Writes an MCAP as a storage of rosbags' writer: a chunk a second, each with its checksum.

    A chunk is written as its messages come, and completed at its end. If this process is killed,
    the last one looks cut off, and has all messages that were flushed.

    Parameters
    ----------
    folder
        The folder of the bag.
    compression
        Which compression the writer asks for; there is none.
    """

    def __init__(self, folder: Path, compression: Any) -> None:
        self.path = folder / f'{folder.name}.mcap'
        self._file = self.path.open('xb')
        self._file.write(MAGIC + _record(_HEADER, 'ros2', 'slip_detector'))
        self._types: list[str] = []
        #: The records that describe types and topics; number of messages of each topic.
        self._described, self._counts = b'', dict[int, int]()
        #: The records on chunks; first and last time of each.
        self._chunk_indexes, self._spans_ns = b'', list[tuple[int, int]]()
        #: Of the chunk that is written where it begins, its length and checksum so far, and topic,
        #: time and place in it of its messages.
        self._begin, self._size, self._checksum = 0, 0, 0
        self._messages = list[tuple[int, int, int]]()

    def add_msgtype(self, connection: Any) -> None:
        """Note the definition of a type."""
        self._types.append(connection.msgtype)
        number, text = pack('<H', len(self._types)), connection.msgdef.data
        self._described += _record(_SCHEMA, number, connection.msgtype, 'ros2msg', text)

    def add_connection(self, connection: Any, offered_qos_profiles: str) -> None:
        """Note the description of a topic."""
        self._counts[connection.id] = 0
        numbers = pack('<HH', connection.id, 1 + self._types.index(connection.msgtype))
        texts = connection.topic, connection.ext.serialization_format
        quality = _sized(_joined('offered_qos_profiles', offered_qos_profiles))
        self._described += _record(_CHANNEL, numbers, *texts, quality)

    def write(self, connection: Any, timestamp: int, data: bytes) -> None:
        """Write a message."""
        first_ns = self._messages[0][1] if self._messages else timestamp
        if self._size > CHUNK_BYTES or abs(timestamp - first_ns) >= CHUNK_NS:
            self._end_chunk()
        if not self._messages:
            self._begin, self._size, self._checksum = self._file.tell(), 0, 0
            self._file.write(_chunk_head(NEVER_ENDS))
            if not self._spans_ns:
                self._put(self._described)
        self._messages.append((connection.id, timestamp, self._size))
        self._counts[connection.id] += 1
        self._put(_record(_MESSAGE, _MESSAGE_HEAD.pack(connection.id, 0, *2 * [timestamp]), data))

    def _put(self, records: bytes) -> None:
        self._file.write(records)
        self._size += len(records)
        self._checksum = zlib.crc32(records, self._checksum)

    def flush(self) -> None:
        """Pass all messages so far to the operating system."""
        self._file.flush()

    def _end_chunk(self) -> None:
        times_ns = [at_ns for _, at_ns, _ in self._messages]
        self._spans_ns.append((min(times_ns), max(times_ns)))
        self._file.seek(self._begin)
        self._file.write(_chunk_head(self._size, self._spans_ns[-1], self._checksum))
        end = self._file.seek(0, os.SEEK_END)
        offsets, index = b'', b''
        for topic in {topic for topic, _, _ in self._messages}:
            places = [pack('<QQ', *place) for own, *place in self._messages if own == topic]
            offsets += pack('<HQ', topic, end + len(index))
            index += _record(_MESSAGE_INDEX, pack('<H', topic), _sized(b''.join(places)))
        self._file.write(index)
        chunk = pack('<QQQQ', *self._spans_ns[-1], self._begin, end - self._begin)
        # The name of no compression is empty, and the length with and without it the same.
        rest = pack('<QIQQ', len(index), 0, self._size, self._size)
        self._chunk_indexes += _record(_CHUNK_INDEX, chunk, _sized(offsets), rest)
        self._messages, self._size = [], 0

    def close(self, version: int, metadata: str) -> None:
        """Write the rest, and a summary with the indexes that other readers need."""
        if self._messages:
            self._end_chunk()
        self._file.write(_record(_DATA_END, bytes(4)))
        counts = [pack('<HQ', *count) for count in self._counts.items()]
        n_all, n_chunks = sum(self._counts.values()), len(self._spans_ns)
        ends_ns = [at_ns for span_ns in self._spans_ns for at_ns in span_ns] or [0]
        numbers = n_all, len(self._types), len(counts), 0, 0, n_chunks, min(ends_ns), max(ends_ns)
        statistics = _record(_STATISTICS, pack('<QHIIIIQQ', *numbers), _sized(b''.join(counts)))
        footer = _record(_FOOTER, pack('<QQI', self._file.tell(), 0, 0))
        summary = self._described + self._chunk_indexes + statistics
        self._file.write(summary + footer + MAGIC)
        self._file.close()

    def abort(self) -> None:
        """Close the file as it is."""
        self._file.close()
