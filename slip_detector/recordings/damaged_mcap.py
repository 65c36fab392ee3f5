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

"""Reads the messages of truncated or damaged MCAP files.

rosbags refuses a file without its end. The package mcap reads it, but returns nothing of a
truncated chunk, and a recorder that dies leaves such a chunk. This reader returns every complete
record before the end of the file, in compressed chunks too.
"""

import contextlib
import struct
import zlib
from collections.abc import Generator, Iterator
from pathlib import Path

from slip_detector.recordings.compression import decompressor
from slip_detector.recordings.topics import Message, Topic

#: Each record of an MCAP file begins with its kind and its length in bytes.
RECORD = struct.Struct('<BQ')
MAGIC = b'\x89MCAP0\r\n'
_HEADER, _FOOTER, _SCHEMA, _CHANNEL, MESSAGE, CHUNK = range(1, 7)
#: Kinds of records whose whole content is read into memory.
READ_WHOLE = (_SCHEMA, _CHANNEL, MESSAGE, CHUNK)
#: Kind of the record after the last message; an index follows.
_DATA_END = 15

#: Bytes that are decompressed at a time; small, as the step with the damage is lost as a whole.
_STEP = 1 << 14


class DamagedMcap:
    """An MCAP file that is truncated or damaged.

    Parameters
    ----------
    path
        The file.
    name
        Name of the file for messages, as ``path`` may be that of a copy.

    Attributes
    ----------
    topics : list of Topic
    lost : str
        Where the file is truncated or damaged; empty if no damage was found so far.
    """

    def __init__(self, path: Path, name: str) -> None:
        self._path, self.name = path, name
        self.lost = ''
        self.topics: list[Topic] = []
        self._channels: dict[int, Topic] = {}
        schemas: dict[int, tuple[str, str, str]] = {}
        for kind, record in self._records():
            with contextlib.suppress(ValueError, struct.error, KeyError):
                if kind == _SCHEMA:
                    (key,), rest = struct.unpack_from('<H', record), record[2:]
                    name, rest = _text(rest)
                    encoding, rest = _text(rest)
                    schemas[key] = (name, encoding, _text(rest)[0])
                elif kind == _CHANNEL:
                    key, schema = struct.unpack_from('<HH', record)
                    self._channels[key] = Topic(_text(record[4:])[0], *schemas[schema])
        self.topics = list(dict.fromkeys(self._channels.values()))

    def messages(self, topics: set[str]) -> Iterator[Message]:
        """Yield the messages of some topics in the order in which they were written."""
        for kind, record in self._records():
            if kind == MESSAGE and len(record) >= 22:
                key, _, received_ns = struct.unpack_from('<HIQ', record)
                topic = self._channels.get(key)
                if topic is not None and topic.name in topics:
                    yield topic.name, received_ns, record[22:]

    def _records(self) -> Iterator[tuple[int, bytes]]:
        """Yield kind and content of each complete record, also of those in chunks."""
        self.lost = ''
        size = self._path.stat().st_size
        with open(self._path, 'rb') as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise ValueError(f'{self.name}: is broken or not mcap')
            end = len(MAGIC)
            while True:
                begin, head = end, file.read(RECORD.size)
                kind, length = RECORD.unpack(head) if len(head) == RECORD.size else (0, 0)
                end += RECORD.size + length
                whole = end <= size
                if kind in (_DATA_END, _FOOTER) and whole:
                    return
                if kind == CHUNK:
                    right = yield from _in_chunk(file.read(min(length, size)), whole)
                    if not right and whole:
                        self.lost = self.lost or f'is damaged at byte {begin} of {size}'
                elif whole and kind in (_SCHEMA, _CHANNEL, MESSAGE):
                    yield kind, file.read(length)
                elif whole:
                    file.seek(length, 1)
                if not whole or not kind:
                    break
            self.lost = self.lost or f'is cut off at byte {size}'


def _in_chunk(chunk: bytes, whole: bool) -> Generator[tuple[int, bytes], None, bool]:
    """Yield the records of a chunk; return whether it is complete and its checksum is right."""
    try:
        _, _, length, checksum = struct.unpack_from('<QQQI', chunk)
        compression, rest = _text(chunk[28:])
        content = b''.join(_decompressed(rest[8:], compression, length))
    except (ValueError, struct.error):
        return False
    right = whole and len(content) == length and checksum in (0, zlib.crc32(content))
    if whole and len(content) == length and not right:
        return False  # Any record may be the wrong one.
    begin = 0
    while begin + RECORD.size <= len(content):
        kind, n = RECORD.unpack_from(content, begin)
        begin += RECORD.size
        if begin + n > len(content):
            return False
        yield kind, content[begin : begin + n]
        begin += n
    return right


def _decompressed(data: bytes, compression: str, most: int) -> Iterator[bytes]:
    """Yield the content of a chunk, up to its length, its truncation or the first damage."""
    if not compression:
        yield data
        return
    stream = decompressor(compression)
    for begin in range(0, len(data), _STEP):
        try:
            part = stream.decompress(data[begin : begin + _STEP], most + 1)
        except Exception:  # Each library has its own exceptions.
            return
        most -= len(part)
        if most < 0:
            return
        yield part


def _text(data: bytes) -> tuple[str, bytes]:
    """Return the text that a record begins with, and the rest of the record."""
    (length,) = struct.unpack_from('<I', data)
    if 4 + length > len(data):
        raise ValueError('the record is too short')
    return data[4 : 4 + length].decode(), data[4 + length :]
