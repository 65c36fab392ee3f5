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

"""The records of MCAP files: their sizes and checksums, and what can be read of a damaged file.

rosbags refuses a file without its end. The package mcap reads one, but nothing of a chunk that is
cut off, and a recorder that dies leaves such a chunk, with seconds of samples.
"""

import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

MAGIC = b'\x89MCAP0\r\n'

#: Each record begins with its kind and its length in bytes.
_RECORD = struct.Struct('<BQ')
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = range(2, 7)
_DATA_END = 15

#: A chunk begins with times of the first and last message, size and checksum (0: none) of the
#: decompressed content, and length of the compression's name, which follows.
_CHUNK_HEAD = struct.Struct('<QQQII')
_CHECKSUM_AT = 24

#: What ends a file that has no index.
_END = _RECORD.pack(_DATA_END, 4) + bytes(4) + _RECORD.pack(_FOOTER, 20) + bytes(20) + MAGIC


def _records(file: IO[bytes], size: int) -> Iterator[tuple[int, int, int]]:
    """Yield kind, first byte and length of the content of each record before the index.

    The last record of a file that is cut off ends beyond its size.
    """
    if file.read(len(MAGIC)) != MAGIC:
        raise ValueError('is broken or not mcap')
    begin = len(MAGIC)
    while begin <= size:
        file.seek(begin)
        kind, length = _RECORD.unpack(file.read(_RECORD.size).ljust(_RECORD.size, b'\xff'))
        if kind in (_DATA_END, _FOOTER):
            return
        begin += _RECORD.size
        yield kind, begin, length
        begin += length


def checksum_warning(path: Path, check_size: Callable[[int, str], None]) -> str:
    """Return one line on messages and chunks without checksum; empty if all have one.

    Parameters
    ----------
    path
        The file.
    check_size
        Raises an error for a record, or the content of a chunk, with too many bytes.
    """
    n_chunks = without = 0
    where = ''
    size = path.stat().st_size
    with open(path, 'rb') as file:
        for kind, begin, length in _records(file, size):
            head = file.read(_CHUNK_HEAD.size)
            if kind == _MESSAGE:
                where = ' of messages outside of chunks'
            if kind in (_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK):
                check_size(min(length, size - begin), f'the record at byte {begin}')
            if kind == _CHUNK and len(head) == _CHUNK_HEAD.size:
                _, _, content_size, checksum, _ = _CHUNK_HEAD.unpack(head)
                check_size(content_size, f'the chunk at byte {begin}')
                n_chunks += 1
                without += not checksum
    if not where and 0 < without < n_chunks:
        where = f' in {without} of {n_chunks} chunks'
    return f'has no checksums{where}, so that damage may go unseen' if where or without else ''


def write_checksums(path: Path) -> None:
    """Write the checksum of each uncompressed chunk that has none, as rosbags leaves them.

    Raises
    ------
    OSError
        When the file cannot be written.
    """
    with open(path, 'r+b') as file:
        for kind, begin, length in _records(file, path.stat().st_size):
            if kind == _CHUNK:
                content = file.read(length)
                *_, checksum, compression = _CHUNK_HEAD.unpack_from(content)
                if not checksum and not compression:
                    file.seek(begin + _CHECKSUM_AT)
                    # Before the content is its length.
                    file.write(struct.pack('<I', zlib.crc32(content[_CHUNK_HEAD.size + 8 :])))


def copy_readable(path: Path, copy: Path, streams: dict[str, Callable[[], Any]]) -> str:
    """Copy all that can be read of a damaged file, so that rosbags reads the copy.

    Parameters
    ----------
    path, copy
        The file, and the new one.
    streams
        For each compression by its name a class of objects that decompress a stream.

    Returns
    -------
    str
        Where the file is damaged or cut off; empty if it is not.

    Raises
    ------
    ValueError
        When the file is no MCAP.
    """
    damage = ''
    size = path.stat().st_size
    with open(path, 'rb') as file, open(copy, 'wb') as new:
        new.write(MAGIC)
        for kind, begin, length in _records(file, size):
            is_whole = begin + length <= size
            content = file.read(max(0, min(length, size - begin)))
            if kind == _CHUNK:
                content, is_intact = _chunk_records(content, is_whole, streams)
                new.write(content)
                if is_whole and not is_intact:
                    damage = damage or f'is damaged at byte {begin - _RECORD.size} of {size}'
            elif is_whole:
                new.write(_RECORD.pack(kind, length) + content)
            if not is_whole:
                damage = damage or f'is cut off at byte {size}'
        new.write(_END)
    return damage


def _chunk_records(
    chunk: bytes, is_whole: bool, streams: dict[str, Callable[[], Any]]
) -> tuple[bytes, bool]:
    """Return the complete records in a chunk, and whether these are all and rightly so."""
    try:
        _, _, size, checksum, n = _CHUNK_HEAD.unpack_from(chunk)
        begin = _CHUNK_HEAD.size + n
        compression, content = chunk[begin - n : begin].decode(), chunk[begin + 8 :]
        if compression:
            content = streams[compression]().decompress(content, size)
    except Exception:  # each library has its own exceptions
        return b'', False
    is_whole = is_whole and len(content) == size
    if is_whole and checksum not in (0, zlib.crc32(content)):
        return b'', False  # any record may be the wrong one
    end = 0
    while end + _RECORD.size <= len(content):
        after = end + _RECORD.size + _RECORD.unpack_from(content, end)[1]
        if after > len(content):
            break
        end = after
    return content[:end], is_whole and end == size
