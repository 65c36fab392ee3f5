"""The checksums of the chunks in MCAP files.

A chunk has the checksum of its content or 0, which stands for none. rosbags writes none, and then
a byte that a disk has changed is taken for a sample.
"""

import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from slip_detector.recordings.damaged_mcap import CHUNK, MAGIC, RECORD

#: In a chunk: times of the first and the last message, length of the content, checksum.
_HEAD = struct.Struct('<QQQI')
_CHECKSUM_AT = 24


class Chunk(NamedTuple):
    """A chunk: first byte and length of its record's content, and its checksum."""

    begin: int
    length: int
    checksum: int


def chunks_of(path: Path) -> Iterator[Chunk]:
    """Yield the chunks of an MCAP file, up to where it is cut; their content is not read."""
    size = path.stat().st_size
    with open(path, 'rb') as file:
        begin = len(MAGIC)
        while begin + RECORD.size <= size:
            file.seek(begin)
            kind, length = RECORD.unpack(file.read(RECORD.size))
            begin += RECORD.size
            if begin + length > size:
                return
            if kind == CHUNK and length >= _HEAD.size:
                yield Chunk(begin, length, _HEAD.unpack(file.read(_HEAD.size))[3])
            begin += length


def without_checksum(path: Path) -> str:
    """Return one line on the chunks without checksum; empty where each has one."""
    checksums = [chunk.checksum for chunk in chunks_of(path)]
    none = checksums.count(0)
    if not none:
        return ''
    where = '' if none == len(checksums) else f' in {none} of {len(checksums)} chunks'
    return f'has no checksums{where}, so that damage may go unseen'


def write_checksums(path: Path) -> None:
    """Give each chunk that is not compressed and has no checksum its own.

    Raises
    ------
    OSError
        When the file cannot be written.
    """
    # The head, the empty name of the compression and the length of the content.
    before = _HEAD.size + 4 + 8
    with open(path, 'r+b') as file:
        for chunk in chunks_of(path):
            file.seek(chunk.begin)
            content = file.read(chunk.length)
            compressed = any(content[_HEAD.size : _HEAD.size + 4])
            if not chunk.checksum and not compressed:
                file.seek(chunk.begin + _CHECKSUM_AT, os.SEEK_SET)
                file.write(struct.pack('<I', zlib.crc32(content[before:])))
