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
import functools
import re
import shutil
import tempfile
import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from slip_detector.parameters.fields import shortened, shown_name
from slip_detector.parameters.files import read_yaml
from slip_detector.recordings.mcap_files import checksum_warning, copy_readable
from slip_detector.recordings.recording import SizeLimit

#: A folder that has this file is a bag.
METADATA = 'metadata.yaml'

#: Endings of the files of a bag; the last is that of ROS 1.
BAG_ENDINGS = ('.mcap', '.db3', '.bag')

#: What repairs a damaged file.
_REPAIRS = {
    '.db3': 'sqlite3 {name} .recover | sqlite3 repaired.db3',
    '.bag': 'rosbag reindex {name}',
    '.zstd': 'zstd -d {name}',
}

#: The first bytes of a message that the recorder has compressed.
_ZSTD = bytes.fromhex('28b52ffd')

#: Separator of the definitions of several types in one text.
_RULE = '=' * 80 + '\n'

_HEADER = 'std_msgs/msg/Header'

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
    limit
        The limit of size.

    Attributes
    ----------
    topics : list of Topic
        Sorted by name.
    counts : dict
        Number of messages of each topic by its name.
    damage : list of str
        One line for each part that the last reading could not read.
    warnings : list of str
        One line for each reason why damage may go unseen.

    Raises
    ------
    ValueError
        When nothing can be read; names the file.
    OSError
        When the path does not exist.
    """

    def __init__(self, path: Path, limit: SizeLimit) -> None:
        self._path = path
        load_rosbags()
        path.stat()
        self.damage: list[str] = []
        self._copy_damage: list[str] = []
        self._last_ns = -1  # time of receipt of the message that was read last
        self.warnings = []
        for file in _files(path):
            warning = checksum_warning(file, limit.check) if file.suffix == '.mcap' else ''
            self.warnings += [f'{file.name} {warning}'] if warning else []
            if file.suffix == '.db3':
                _check_pages(file)
        #: What rosbags opens, one after the other: the bag or, if it is damaged, its files.
        self._parts, self._are_copies = [path], False
        try:
            if path.is_dir():  # what is nested too deep ends the parser of rosbags
                read_yaml(path / METADATA)
            connections = self._connections()
        except ValueError:
            self._copy_readable()
            connections = self._connections()
        by_name = {
            one.topic: Topic(one.topic, one.msgtype, one.msgdef.format.name, one.msgdef.data)
            for one in connections
        }
        self.counts = {one.topic: one.msgcount for one in connections}
        self.topics = [by_name[name] for name in sorted(by_name)]

    def messages(self, topic: Topic) -> Iterator[Message]:
        """Yield the messages of a topic in order of receipt, as far as damage allows.

        Raises
        ------
        ValueError
            When the bag is damaged and no MCAP; says how to repair it.
        """
        self.damage = [*self._copy_damage]
        self._last_ns = -1
        yield from self._up_to_damage(topic)
        # rosbags omits a topic on which metadata.yaml and the files disagree.
        is_complete = not self.damage and (self._last_ns >= 0 or self._path.is_file())
        if not is_complete and not self._are_copies:
            self._copy_readable()
            last_ns = self._last_ns
            yield from (message for message in self._up_to_damage(topic) if message[0] > last_ns)

    def _up_to_damage(self, topic: Topic) -> Iterator[Message]:
        try:
            for part in self._parts:
                is_ros_1 = part.suffix == '.bag'
                with _reader(part) as reader:
                    wanted = [one for one in reader.connections if one.topic == topic.name]
                    for _, received_ns, raw in reader.messages(wanted) if wanted else ():
                        # SQLite stores any type in any column.
                        if type(received_ns) is not int or type(raw) is not bytes:
                            raise ValueError('a message has no bytes or no time')
                        cdr = raw
                        if is_ros_1:
                            cdr = bytes(typestore_of(topic).ros1_to_cdr(raw, topic.msgtype))
                        elif self._are_copies and raw.startswith(_ZSTD):
                            cdr = _unpacked(raw)
                        self._last_ns = received_ns
                        yield received_ns, cdr
        except ValueError as error:
            if any(file.suffix in _REPAIRS for file in _files(self._path)):
                raise
            self.damage.append(str(error))

    def _connections(self) -> list[Any]:
        """Return what rosbags says about the topics."""
        connections = []
        for part in self._parts:
            with _reader(part) as reader:
                connections += reader.connections
        return connections

    def _copy_readable(self) -> None:
        """Open the files one by one, MCAP files as copies of what can be read of them."""
        from lz4.frame import LZ4FrameDecompressor

        streams = {'zstd': _zstd().ZstdDecompressor, 'lz4': LZ4FrameDecompressor}
        folder = Path(tempfile.mkdtemp(prefix='slip_detector_'))
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        self._parts, self._are_copies = [], True
        for k, file in enumerate(_files(self._path)):
            if file.suffix == '.mcap':
                copy = folder / f'{k}.mcap'
                damage = copy_readable(file, copy, streams)
                self._copy_damage += [f'{file.name} {damage}'] if damage else []
                self._parts.append(copy)
            else:
                self._parts.append(file)
        self.damage += self._copy_damage
        if not self._parts:
            raise ValueError('has no files of a bag, allowed: .mcap or .db3')


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
        raise ValueError(f'{part.name} is damaged ({why}){_repair(part)}') from None


def _repair(file: Path) -> str:
    repair = _REPAIRS.get(file.suffix, '').format(name=file.name)
    return f', allowed: a whole file; this repairs it: {repair}' if repair else ''


def _check_pages(database: Path) -> None:
    """Check that a database is not cut off: SQLite would read a part of a page as content."""
    with open(database, 'rb') as file:
        head = file.read(100)
    page = int.from_bytes(head[16:18], 'big')
    page = 65536 if page == 1 else page or 1
    pages, size = int.from_bytes(head[28:32], 'big'), database.stat().st_size
    if size % page or size < pages * page:
        raise ValueError(f'{database.name} is cut off at byte {size}{_repair(database)}')


def _zstd() -> Any:
    """Return the module for zstd that rosbags uses: Python's own from 3.14 on."""
    from rosbags.rosbag2 import reader

    return vars(reader)['zstd']


def _unpacked(raw: bytes) -> bytes:
    """Return a decompressed message; empty if damaged, so that it is left out."""
    try:
        return bytes(_zstd().decompress(raw))
    except Exception:
        return b''


def _files(path: Path) -> list[Path]:
    """Return the files of a bag in the order of their numbers."""
    if path.is_file():
        return [path]
    files = [file for file in path.iterdir() if file.suffix in ('.mcap', '.db3', '.zstd')]
    return sorted(files, key=lambda file: [int(n) for n in re.findall(r'\d+', file.name)])


@functools.lru_cache(maxsize=64)
def typestore_of(topic: Topic) -> Any:
    """Return a type store of rosbags with the type of a topic.

    If the definition in the bag is broken, as some recorders write it, the definition of ROS is
    used. The store is cached for the same topic of other recordings, as it compiles code for its
    types.

    Raises
    ------
    ValueError
        When ROS does not have the type, and the bag does not define it or its definition is
        broken.
    """
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    known, msgtype = get_typestore(Stores.LATEST), shown_name(topic.msgtype)
    why = f'the bag does not define the type {msgtype} of {shown_name(topic.name)}'
    try:
        store = get_typestore(Stores.EMPTY)
        if topic.encoding == 'MSG':
            types = get_types_from_msg(topic.definition, topic.msgtype)
            if _HEADER in types:  # rosbags skips the number that only ROS 1 has
                constants, fields = types[_HEADER]
                types[_HEADER] = (constants, [field for field in fields if field[0] != 'seq'])
            store.register(types)
        elif topic.encoding == 'IDL':
            parts = topic.definition.split(_RULE)
            # If there are several definitions, the first line of each is the name of its type.
            for text in parts if len(parts) == 1 else [p.partition('\n')[2] for p in parts[1:]]:
                store.register(get_types_from_idl(text))
        if topic.encoding != 'NONE':
            store.get_msgdef(topic.msgtype)
            return store
    except Exception as error:
        short = shortened(' '.join(str(error).split()))
        why = f'the definition of {msgtype} cannot be read ({short})'
    if topic.msgtype not in known.fielddefs:
        raise ValueError(why)
    return known
