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

"""The records of MCAP files: their checksums, and what can be read of a file that was cut off."""

import shutil
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO

MAGIC = b'\x89MCAP0\r\n'

#: Each record begins with its kind and its length in bytes.
_RECORD = struct.Struct('<BQ')
_FOOTER, _MESSAGE, _CHUNK, _DATA_END = 2, 5, 6, 15

#: A chunk begins with times of the first and last message, size and checksum (0: none) of the
#: decompressed content, and length of the compression's name, which follows.
_CHUNK_HEAD = struct.Struct('<QQQII')
_CHECKSUM_AT = 24

#: What ends a file that has no index.
_END = _RECORD.pack(_DATA_END, 4) + bytes(4) + _RECORD.pack(_FOOTER, 20) + bytes(20) + MAGIC


def _records(file: IO[bytes], size: int) -> Iterator[tuple[int, int, int]]:
    """Yield kind, first byte and length of the content of each whole record before the index."""
    begin = len(MAGIC) + _RECORD.size
    while begin <= size:
        file.seek(begin - _RECORD.size)
        kind, length = _RECORD.unpack(file.read(_RECORD.size))
        if kind in (_DATA_END, _FOOTER) or begin + length > size:
            return
        yield kind, begin, length
        begin += length + _RECORD.size


def has_checksums(path: Path) -> bool:
    """Return whether all messages are in chunks with checksums."""
    with open(path, 'rb') as file:
        for kind, begin, _ in _records(file, path.stat().st_size):
            file.seek(begin + _CHECKSUM_AT)
            if kind == _MESSAGE or (kind == _CHUNK and file.read(4) == bytes(4)):
                return False
    return True


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


def copy_whole_records(path: Path, copy: Path) -> int:
    """Copy an MCAP up to its last whole record, so that rosbags reads the copy.

    Returns
    -------
    int
        The first byte that is not copied.
    """
    with open(path, 'rb') as file, open(copy, 'w+b') as new:
        *_, (_, begin, length) = [(0, 0, 0), *_records(file, path.stat().st_size)]
        file.seek(0)
        shutil.copyfileobj(file, new)
        new.truncate(begin + length)
        new.seek(0, 2)
        new.write(_END)
    return begin + length
