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

"""The chunks of MCAP files: their sizes and their checksums.

A chunk has the checksum of its content, or 0 for no checksum. rosbags writes 0, so that a byte
that a disk has corrupted would pass as a sample.
"""

import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from slip_detector.recordings.damaged_mcap import CHUNK, MAGIC, MESSAGE, READ_WHOLE, RECORD
from slip_detector.recordings.reading_limit import ReadingLimit

#: Head of a chunk: times of the first and the last message, length of the content, checksum.
_HEAD = struct.Struct('<QQQI')
_CHECKSUM_AT = 24


class Chunk(NamedTuple):
    """Place and head of a chunk.

    Attributes
    ----------
    begin, length : int
        First byte and length of its record's content.
    size : int
        Length of the decompressed content, according to the head.
    checksum : int
        Checksum of the decompressed content; 0: none.

    Examples
    --------
    >>> Chunk(begin=40, length=140, size=100, checksum=0).size
    100
    """

    begin: int
    length: int
    size: int
    checksum: int


def _records(path: Path) -> Iterator[tuple[int, int, int, bytes]]:
    """Yield kind, begin, length and first bytes of the content of each record of an MCAP file.

    The last record may be truncated; its length is that of the remaining part.
    """
    size = path.stat().st_size
    with open(path, 'rb') as file:
        begin = len(MAGIC)
        while begin + RECORD.size <= size:
            file.seek(begin)
            first = file.read(RECORD.size + _HEAD.size)
            kind, length = RECORD.unpack_from(first)
            begin += RECORD.size
            yield kind, begin, min(length, size - begin), first[RECORD.size :]
            begin += length


def _chunk(begin: int, length: int, first: bytes) -> Chunk | None:
    """Return the chunk that begins with these bytes; None if its head is truncated."""
    if length < _HEAD.size:
        return None
    _, _, size, checksum = _HEAD.unpack(first)
    return Chunk(begin, length, size, checksum)


def chunks_of(path: Path) -> Iterator[Chunk]:
    """Yield the chunks of an MCAP file whose heads are complete; their content is not read.

    Examples
    --------
    >>> import numpy as np
    >>> import tempfile
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.recordings import write_recording
    >>> rows = Samples(np.full((4, 2), 4.3), np.arange(4) * 10_000_000, None)
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = Path(folder.name) / 'trial.mcap'
    >>> write_recording(path, [rows], 100.0, ['a', 'b'])
    >>> [chunk.length - chunk.size for chunk in chunks_of(path)]
    [40]
    >>> folder.cleanup()
    """
    for kind, begin, length, first in _records(path):
        if kind == CHUNK and (chunk := _chunk(begin, length, first)):
            yield chunk


def survey(path: Path, limit: ReadingLimit) -> str:
    """Check that no record and no decompressed chunk exceeds the memory limit.

    Returns
    -------
    str
        One line on messages and chunks without checksum; empty if all have one.

    Raises
    ------
    ValueError
        When a record or a chunk is too large; names its place.
    """
    n_chunks = none = 0
    messages = False
    for kind, begin, length, first in _records(path):
        if kind in READ_WHOLE:
            limit.check(length, f'the record at byte {begin}')
        messages = messages or kind == MESSAGE
        if kind == CHUNK and (chunk := _chunk(begin, length, first)):
            limit.check(chunk.size, f'the chunk at byte {begin}')
            n_chunks += 1
            none += not chunk.checksum
    if messages:
        where = ' of messages outside of chunks'
    elif not none:
        return ''
    else:
        where = '' if none == n_chunks else f' in {none} of {n_chunks} chunks'
    return f'has no checksums{where}, so that damage may go unseen'


def write_checksums(path: Path) -> None:
    """Write the checksum of each uncompressed chunk that has none.

    Raises
    ------
    OSError
        When the file cannot be written.
    """
    # Bytes before the content: head, empty name of the compression, length of the content.
    before = _HEAD.size + 4 + 8
    with open(path, 'r+b') as file:
        for chunk in chunks_of(path):
            file.seek(chunk.begin)
            content = file.read(chunk.length)
            compressed = any(content[_HEAD.size : _HEAD.size + 4])
            if not chunk.checksum and not compressed:
                file.seek(chunk.begin + _CHECKSUM_AT, os.SEEK_SET)
                file.write(struct.pack('<I', zlib.crc32(content[before:])))
