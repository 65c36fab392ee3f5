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

"""Reads the messages of MCAP files from the front, up to any damage; indexes are not read."""

import io
import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, NamedTuple

#: The first and the last bytes of an MCAP.
MAGIC = b'\x89MCAP0\r\n'

#: A record begins with its opcode and its length in bytes; 1 to 15 are opcodes of the format, 128
#: to 255 those of applications.
_RECORD = struct.Struct('<BQ')
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 2, 3, 4, 5, 6
_OPCODES, _IN_CHUNK = (*range(1, 16), *range(128, 256)), (_SCHEMA, _CHANNEL, _MESSAGE)

#: A message begins with its channel, number, time of receipt and time of publishing; a chunk with
#: its first and last time, its length, its checksum (0: none) and the length of what follows, the
#: name of its compression.
_MESSAGE_HEAD, _CHUNK_HEAD = struct.Struct('<HIQQ'), struct.Struct('<QQQII')


class Topic(NamedTuple):
    """A topic of a bag: its name, and name, format (as ros2msg) and definition of its type."""

    name: str
    msgtype: str
    encoding: str
    definition: str


#: Topic, time of receipt in nanoseconds, serialised message.
Received = tuple[Topic, int, bytes]


class DamageError(ValueError):
    """Damage to a file, of which all before it was read."""


def read_mcap(path: Path) -> Iterator[Received]:
    """Yield the messages of all topics in the order of the file.

    At damage a DamageError says where it is; damage within a record may raise anything.
    """
    schemas, topics = dict[int, list[str]](), dict[int, Topic]()
    with open(path, 'rb') as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise DamageError('is damaged at byte 0, or no MCAP')
        for opcode, record in _read_records(file, len(MAGIC)):
            number = int.from_bytes(record[:2], 'little')
            if opcode == _MESSAGE:
                at_ns = _MESSAGE_HEAD.unpack_from(record)[2]
                yield topics[number], at_ns, record[_MESSAGE_HEAD.size :]
            elif opcode == _SCHEMA:
                schemas[number] = _read_texts(record[2:], 3)
            elif opcode == _CHANNEL:
                described = schemas.get(int.from_bytes(record[2:4], 'little'), ['', '', ''])
                topics[number] = Topic(*_read_texts(record[4:], 1), *described)


def _read_records(data: IO[bytes], begin: int, chunk: int = 0) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of what describes topics and of messages, up to the footer.

    ``chunk`` is the first byte of the chunk that the data are; 0: they are the file.
    """
    from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

    size = data.seek(0, os.SEEK_END)
    while begin < size:
        data.seek(begin)
        opcode, length = _RECORD.unpack(data.read(_RECORD.size).ljust(_RECORD.size, b'\0'))
        if opcode not in (_IN_CHUNK if chunk else _OPCODES):
            raise DamageError(f'is damaged at byte {chunk or begin}')
        if opcode == _FOOTER:
            return
        place, begin = begin, begin + _RECORD.size + length
        is_whole = begin <= size
        if opcode in _IN_CHUNK and is_whole:
            yield opcode, data.read(length)
        elif opcode == _CHUNK:
            content = data.read(min(begin, size) - data.tell()).ljust(_CHUNK_HEAD.size, b'\0')
            *_, n_bytes, checksum, n = _CHUNK_HEAD.unpack_from(content)
            name_end = _CHUNK_HEAD.size + n
            records_at = name_end + 8  # Behind the length when compressed.
            if is_whole:
                unpack = DECOMPRESSORS[content[_CHUNK_HEAD.size : name_end].decode()]
                raw = unpack(content[records_at:], n_bytes)
                if len(raw) != n_bytes or (checksum and zlib.crc32(raw) != checksum):
                    raise DamageError(f'has a damaged chunk at byte {place}')
                yield from _read_records(io.BytesIO(raw), 0, place)
            elif not n:  # What is there of a chunk that is not compressed is records.
                begin = place + _RECORD.size + records_at
    if chunk and begin > size:
        raise DamageError(f'has a damaged chunk at byte {chunk}')
    if not chunk:
        raise DamageError(f'is cut off at byte {size}')


def _read_texts(content: bytes, n: int) -> list[str]:
    """Return the texts at the beginning of a record, each after its length."""
    data = io.BytesIO(content)
    return [data.read(int.from_bytes(data.read(4), 'little')).decode() for _ in range(n)]
