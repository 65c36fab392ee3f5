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

"""Reads the messages of a bag with rosbags, and of a damaged bag what comes before the damage."""

import contextlib
import functools
import os
import re
import shutil
import struct
import tempfile
import weakref
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, NamedTuple

from slip_detector.parameters.fields import name_list, shortened, shown_name
from slip_detector.parameters.files import read_yaml

#: A folder that has this file is a bag.
METADATA = 'metadata.yaml'

#: The only key of that file.
ABOUT = 'rosbag2_bagfile_information'

#: Endings of the files of a bag; the last is that of ROS 1.
BAG_ENDINGS = ('.mcap', '.db3', '.bag')

HEADER = 'std_msgs/msg/Header'

#: The first bytes of an MCAP.
MAGIC = b'\x89MCAP0\r\n'

#: Each record begins with its kind and its length in bytes.
_RECORD = struct.Struct('<BQ')
_FOOTER, _MESSAGE, _CHUNK, _DATA_END = 2, 5, 6, 15

#: Places in a chunk of its checksum (0: none) and, where it is not compressed, of its records.
_CHECKSUM_AT, _RECORDS_AT = 24, 40

#: What ends a file that has no index.
_END = _RECORD.pack(_DATA_END, 4) + bytes(4) + _RECORD.pack(_FOOTER, 20) + bytes(20) + MAGIC

#: Time of receipt in nanoseconds, serialised message (CDR).
Message = tuple[int, bytes]


class Topic(NamedTuple):
    """A topic of a bag: its name, and name, format (MSG, IDL, NONE) and definition of its type."""

    name: str
    msgtype: str
    encoding: str
    definition: str


class BagStorage:
    """The messages of a bag.

    Parameters
    ----------
    path
        The folder of a bag, or one of its files.

    Attributes
    ----------
    topics : list of Topic
        Those with messages, sorted by name.
    damage : list of str
        One line for each part that could not be read so far.
    doubts : str
        Why damage may go unseen; empty if it cannot.
    custom_data : dict
        What the one who recorded has noted in ``metadata.yaml``, by key.

    Raises
    ------
    ValueError
        When nothing can be read; names the file.
    OSError
        When the path does not exist.
    """

    def __init__(self, path: Path) -> None:
        load_rosbags()
        path.stat()
        files = [path] if path.is_file() else _files(path)
        some = [one.name for one in files if one.suffix == '.mcap' and not has_checksums(one)]
        names = name_list(some)
        self.doubts = f'{names}: without checksums, so that damage may go unseen' if some else ''
        #: What rosbags opens, one after the other: the bag or, if it is damaged, its files.
        self._parts = [path]
        self.damage: list[str] = []
        self.custom_data: dict[str, Any] = {}
        try:
            if path.is_dir():  # what is nested too deep ends the parser of rosbags
                about = read_yaml(path / METADATA).get(ABOUT) or {}
                self.custom_data = about.get('custom_data') or {}
            connections = _connections(path)
        except ValueError:
            connections = self._open_singly(files)
        by_name = {
            one.topic: Topic(one.topic, one.msgtype, one.msgdef.format.name, one.msgdef.data)
            for one in connections
            if one.msgcount
        }
        self.topics = sorted(by_name.values())

    def messages(self, topic: Topic) -> Iterator[Message]:
        """Yield the messages of a topic in order of receipt, up to any damage."""
        for part in self._parts:
            try:
                with _reader(part) as reader:
                    wanted = [one for one in reader.connections if one.topic == topic.name]
                    for _, received_ns, raw in reader.messages(wanted) if wanted else ():
                        cdr = raw
                        if part.suffix == '.bag':
                            cdr = bytes(typestore_of(topic).ros1_to_cdr(raw, topic.msgtype))
                        yield received_ns, cdr
            except ValueError as error:
                self.damage += [] if str(error) in self.damage else [str(error)]

    def _open_singly(self, files: list[Path]) -> list[Any]:
        """Open each file for itself, and a copy of an MCAP that was cut off."""
        if not files:
            raise ValueError('has no files of a bag, allowed: .mcap or .db3')
        folder = Path(tempfile.mkdtemp(prefix='slip_detector_'))
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        self._parts, connections = [], []
        for file in files:
            part = file
            try:
                connections += _connections(part)
            except ValueError:
                if file.suffix != '.mcap':
                    raise
                part = folder / file.name
                end = copy_whole_records(file, part)
                self.damage.append(f'{file.name} is cut off at byte {end}')
                connections += _connections(part)
            self._parts.append(part)
        return connections


def load_rosbags() -> Any:
    """Import the part of rosbags that reads and writes bags.

    Raises
    ------
    ValueError
        When it is not installed; says how to install it.
    """
    try:
        from rosbags import rosbag2
    except ImportError:
        raise ValueError('bags need the package rosbags: pip install rosbags') from None
    return rosbag2


@contextlib.contextmanager
def _reader(part: Path) -> Iterator[Any]:
    """Open a bag or one of its files; errors are one line with its name."""
    from rosbags import rosbag1, rosbag2

    try:
        with (rosbag1 if part.suffix == '.bag' else rosbag2).Reader(part) as reader:
            yield reader
    except Exception as error:  # rosbags raises many kinds of error for a damaged file
        why = shortened(' '.join(str(error).split()))
        raise ValueError(f'{part.name} is damaged ({why})') from None


def _connections(part: Path) -> list[Any]:
    """Return what rosbags says about the topics."""
    with _reader(part) as reader:
        return list(reader.connections)


def _files(folder: Path) -> list[Path]:
    """Return the files of a bag in the order of their numbers."""
    files = [file for file in folder.iterdir() if file.suffix in BAG_ENDINGS]
    return sorted(files, key=lambda file: [int(n) for n in re.findall(r'\d+', file.name)])


@functools.lru_cache(maxsize=64)
def typestore_of(topic: Topic) -> Any:
    """Return a type store of rosbags with the type of a topic.

    If the definition in the bag is broken, as some recorders write it, or missing, that of ROS is
    used. The store is cached for the same topic of other recordings, as it compiles code for its
    types.

    Raises
    ------
    ValueError
        When ROS does not have the type either.
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    try:
        types: dict[str, Any] = {}
        if topic.encoding == 'MSG':
            types = get_types_from_msg(topic.definition, topic.msgtype)
        if HEADER in types:  # rosbags skips the number that only ROS 1 has
            constants, fields = types[HEADER]
            types[HEADER] = (constants, [field for field in fields if field[0] != 'seq'])
        store = get_typestore(Stores.EMPTY)
        store.register(types)
        store.get_msgdef(topic.msgtype)
    except Exception as error:
        store = get_typestore(Stores.LATEST)
        if topic.msgtype not in store.fielddefs:
            why = shortened(' '.join(str(error).split()))
            raise ValueError(
                f'{shown_name(topic.name)} is {shown_name(topic.msgtype)}, of which the bag has '
                f'no definition that can be read ({why})'
            ) from None
    return store


def _records(file: IO[bytes]) -> Iterator[tuple[int, int, int]]:
    """Yield kind, first byte and length of the content of each whole record before the index."""
    begin, size = len(MAGIC) + _RECORD.size, os.fstat(file.fileno()).st_size
    while begin <= size:
        file.seek(begin - _RECORD.size)
        kind, length = _RECORD.unpack(file.read(_RECORD.size))
        if kind in (_DATA_END, _FOOTER) or begin + length > size:
            return
        yield kind, begin, length
        begin += length + _RECORD.size


def has_checksums(path: Path) -> bool:
    """Return whether all messages of an MCAP are in chunks with checksums."""
    with open(path, 'rb') as file:
        for kind, begin, _ in _records(file):
            file.seek(begin + _CHECKSUM_AT)
            if kind == _MESSAGE or (kind == _CHUNK and file.read(4) == bytes(4)):
                return False
    return True


def write_checksums(path: Path) -> None:
    """Give each chunk of an MCAP, none of which is compressed, the checksum that rosbags omits.

    Raises
    ------
    OSError
        When the file cannot be written.
    """
    with open(path, 'r+b') as file:
        for kind, begin, length in _records(file):
            if kind == _CHUNK:
                file.seek(begin + _RECORDS_AT)
                checksum = zlib.crc32(file.read(length - _RECORDS_AT))
                file.seek(begin + _CHECKSUM_AT)
                file.write(struct.pack('<I', checksum))


def copy_whole_records(path: Path, copy: Path) -> int:
    """Copy an MCAP up to its last whole record before the index, so that rosbags reads the copy.

    Returns
    -------
    int
        The first byte that is not copied.
    """
    with open(path, 'rb') as file, open(copy, 'w+b') as new:
        *_, (_, begin, length) = [(0, 0, 0), *_records(file)]
        file.seek(0)
        shutil.copyfileobj(file, new)
        new.truncate(begin + length)
        new.seek(0, os.SEEK_END)
        new.write(_END)
    return begin + length
