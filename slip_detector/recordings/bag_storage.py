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

"""Reads the messages of a bag with rosbags, and what can be read of a damaged bag."""

import contextlib
import re
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from slip_detector.parameters.files import read_yaml
from slip_detector.recordings.compression import decompressed, decompressor
from slip_detector.recordings.damaged_database import DamagedDatabase
from slip_detector.recordings.damaged_mcap import DamagedMcap
from slip_detector.recordings.mcap_chunks import survey
from slip_detector.recordings.reading_limit import ReadingLimit
from slip_detector.recordings.topics import Message, Topic

#: A folder that has this file is a bag.
METADATA = 'metadata.yaml'

_DAMAGED: dict[str, type[DamagedMcap | DamagedDatabase]] = {
    '.mcap': DamagedMcap,
    '.db3': DamagedDatabase,
}

#: Endings of the files of a bag.
BAG_ENDINGS = tuple(_DAMAGED)

#: Ending of a bag's file that the recorder has compressed as a whole.
_COMPRESSED = '.zstd'

#: Largest ratio of a decompressed file to its size, in addition to the memory limit.
MOST_RATIO = 100

#: Bytes that are copied at a time.
_STEP = 1 << 20

#: Offset of the page size in an SQLite file.
_PAGE_SIZE_AT = 16


def load_rosbags() -> Any:
    """Import the part of rosbags that reads and writes bags.

    Raises
    ------
    ValueError
        When it is not installed; says how to install it.

    Examples
    --------
    >>> load_rosbags().__name__
    'rosbags.rosbag2'
    """
    try:
        from rosbags import rosbag2
        from rosbags.rosbag2 import storage_mcap
    except ImportError:
        raise ValueError('bags need the package rosbags: pip install rosbags') from None
    # rosbags would decompress a chunk to any length before it compares the length.
    for name in ('zstd', 'lz4'):
        storage_mcap.DECOMPRESSORS[name] = partial(_chunk_content, name)
    return rosbag2


def _chunk_content(compression: str, data: bytes, size: int) -> bytes:
    return decompressed(data, compression, size)


class BagStorage:
    """The messages of a bag.

    Parameters
    ----------
    path
        The folder of a bag, or one of its files.
    limit
        The memory limit.

    Attributes
    ----------
    topics : list of Topic
        Sorted by name.
    counts : dict
        Number of messages of each topic by its name, as far as the bag tells it.
    lost : list of str
        One line for each part that the last reading could not read.
    doubts : list of str
        One line for each reason why damage may go unnoticed.

    Raises
    ------
    ValueError
        When nothing can be read; names the file.
    OSError
        When the path does not exist.
    """

    def __init__(self, path: Path, limit: ReadingLimit) -> None:
        self._path, self._limit = path, limit
        self._rosbag2 = load_rosbags()
        self.lost: list[str] = []
        path.stat()
        surveys = {file: survey(file, limit) for file in _files(path) if file.suffix == '.mcap'}
        self.doubts = [f'{file.name} {line}' for file, line in surveys.items() if line]
        metadata = _metadata(path)
        self._compression = str(metadata.get('compression_mode')).lower()
        try:
            # Not read with rosbags, which decompresses files and messages to any length.
            if self._compression in ('file', 'message') or (path.is_dir() and not metadata):
                raise ValueError('is compressed, or has no metadata')
            with self._rosbag2.Reader(path) as reader:
                topics = [_topic(connection) for connection in reader.connections]
                counts = [(one.topic, one.msgcount) for one in reader.connections]
                self._whole = True
        except Exception:  # rosbags raises many kinds of error for a truncated file.
            self._whole = False
            counts = _counts(metadata)
            with self._readers() as readers:
                topics = [topic for reader in readers for topic in reader.topics]
                self.lost = [f'{reader.name} {reader.lost}' for reader in readers if reader.lost]
        self.counts = dict(counts)
        by_name = {topic.name: topic for topic in topics}
        self.topics = [by_name[name] for name in sorted(by_name)]

    def messages(self, topics: set[str]) -> Iterator[Message]:
        """Yield the messages of some topics in order of receipt, as far as damage allows."""
        self.lost = []
        last_ns = -1
        if self._whole:
            try:
                for message in self._messages_of_whole(topics):
                    # SQLite stores any type in any column.
                    if not isinstance(message[1], int) or not isinstance(message[2], bytes):
                        raise ValueError('a message has no bytes or no time')
                    last_ns = message[1]
                    yield message
                if last_ns >= 0:
                    return
                # rosbags omits a topic on which metadata.yaml and the files disagree.
            except Exception as error:  # rosbags reaches the damage only here.
                why = ' '.join(str(error).split())
                self.lost.append(f'{self._path.name} is damaged ({why})')
        per_message = self._compression == 'message'
        with self._readers() as readers:
            for reader in readers:
                for topic, received_ns, raw in reader.messages(topics):
                    if received_ns > last_ns:
                        if per_message:
                            raw = _message(raw, self._limit)  # noqa: PLW2901
                        yield topic, received_ns, raw
                if reader.lost:
                    self.lost.append(f'{reader.name} {reader.lost}')

    def _messages_of_whole(self, topics: set[str]) -> Iterator[Message]:
        with self._rosbag2.Reader(self._path) as reader:
            wanted = [one for one in reader.connections if one.topic in topics]
            if wanted:
                for connection, received_ns, raw in reader.messages(wanted):
                    yield connection.topic, received_ns, raw

    @contextlib.contextmanager
    def _readers(self) -> 'Iterator[list[DamagedMcap | DamagedDatabase]]':
        """Open each file of the bag as far as it can be read."""
        with tempfile.TemporaryDirectory() as folder:
            files = [_readable(file, Path(folder), self._limit) for file in _files(self._path)]
            if not files:
                raise ValueError('has no files of a bag, allowed: .mcap or .db3')
            names = [file.name.removesuffix(_COMPRESSED) for file in _files(self._path)]
            yield [
                _DAMAGED[file.suffix](file, name) for file, name in zip(files, names, strict=True)
            ]


def _topic(connection: Any) -> Topic:
    encoding = {'MSG': 'ros2msg', 'IDL': 'ros2idl'}.get(connection.msgdef.format.name, '')
    name, msgtype = str(connection.topic), str(connection.msgtype)
    return Topic(name, msgtype, encoding, connection.msgdef.data)


def _metadata(path: Path) -> dict[str, Any]:
    """Return the metadata of a bag; empty if they are missing or damaged."""
    try:
        return dict(read_yaml(path / METADATA)['rosbag2_bagfile_information'])
    except (ValueError, TypeError, KeyError):
        return {}


def _message(raw: bytes, limit: ReadingLimit) -> bytes:
    """Return a decompressed message; empty if damaged, so that the decoder leaves it out."""
    try:
        return decompressed(raw, 'zstd', limit.message_bytes)
    except ValueError:
        return b''


def _counts(metadata: dict[str, Any]) -> list[tuple[str, int]]:
    """Return the number of messages of each topic; empty if the metadata do not have it."""
    try:
        return [
            (str(topic['topic_metadata']['name']), int(topic['message_count']))
            for topic in metadata['topics_with_message_count']
        ]
    except (KeyError, TypeError, ValueError):
        return []


def _files(path: Path) -> list[Path]:
    """Return the files of a bag in the order of their numbers."""
    if path.is_file():
        return [path]
    endings = (*BAG_ENDINGS, *(f'{ending}{_COMPRESSED}' for ending in BAG_ENDINGS))
    files = [file for file in path.iterdir() if file.name.endswith(endings)]
    return sorted(files, key=lambda file: [int(n) for n in re.findall(r'\d+', file.name)])


def _readable(file: Path, folder: Path, limit: ReadingLimit) -> Path:
    """Return the file itself or, if it must be changed to be read, a copy in the folder.

    A file that was compressed as a whole is decompressed up to the damage. A database is truncated
    to whole pages: SQLite fills an incomplete page with zeros and reads them as content.
    """
    if file.suffix == _COMPRESSED:
        unpacked = folder / file.stem
        stream = decompressor('zstd')
        left = limit.most_bytes + MOST_RATIO * file.stat().st_size
        with (
            open(file, 'rb') as packed,
            open(unpacked, 'wb') as plain,
            contextlib.suppress(Exception),  # keep the part before the damage
        ):
            while left > 0 and (part := packed.read(_STEP)):
                left -= plain.write(stream.decompress(part, left))
        if left <= 0:
            raise ValueError(f'{file.name} decompresses to more than {MOST_RATIO} times its size')
        file = unpacked
        if file.suffix == '.mcap':
            survey(file, limit)
    if file.suffix == '.db3':
        with open(file, 'rb') as database:
            database.seek(_PAGE_SIZE_AT)
            page = int.from_bytes(database.read(2), 'big') or 1
            page = 65536 if page == 1 else page
            left = file.stat().st_size // page * page
            if left < file.stat().st_size:
                database.seek(0)
                cut = folder / f'whole_pages_of_{file.name}'
                with open(cut, 'wb') as copy:
                    while left and (part := database.read(min(_STEP, left))):
                        left -= copy.write(part)
                file = cut
    return file
