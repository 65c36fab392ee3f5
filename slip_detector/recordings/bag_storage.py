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

"""Reads the messages of bags in the order of their files, of a damaged file up to the damage."""

import contextlib
import functools
import glob
import re
import sqlite3
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path, PurePath
from typing import Any

from slip_detector.parameters import name_list, quote_name, read_yaml, refuse, shortened
from slip_detector.recordings.mcap import DamageError, Received, Topic, read_mcap

#: The file that makes a folder a bag.
METADATA = 'metadata.yaml'

#: The only key of ``metadata.yaml``.
INFORMATION = 'rosbag2_bagfile_information'

#: Endings of the files of a bag; .bag is that of ROS 1.
BAG_ENDINGS = ('.mcap', '.db3', '.bag')

#: Ending of a file that was compressed as a whole.
PACKED = '.zstd'

HEADER = 'std_msgs/msg/Header'

#: The first bytes of what zstd compressed.
_ZSTD = b'\x28\xb5\x2f\xfd'

#: Time of receipt in nanoseconds, serialised message (CDR).
Message = tuple[int, bytes]


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
        One line for each part that cannot be read, is left out or contradicts another.
    counts : Counter
        Number of messages of each topic, by its name.
    custom_data : dict
        Notes of the recorder in ``metadata.yaml``, by key.

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
        self.damage, self.custom_data = list[str](), dict[str, Any]()
        self._n_listed: Any = None
        self._files = self._files_of(path) if path.is_dir() else [path]
        self.counts, topics = Counter[str](), dict[str, Topic]()
        for file in self._files:
            try:
                for topic, _, _ in _read_messages(file):
                    self.counts[topic.name] += 1
                    topics[topic.name] = topic
            except DamageError as error:
                self.damage.append(f'{file.name} {error}')
            # A -wal or a -journal.
            for journal in file.parent.glob(f'{glob.escape(file.name)}-*l'):
                mend = f'sqlite3 {file} "PRAGMA wal_checkpoint" takes it in'
                self.damage.append(f'{journal.name} beside it is not read: {mend}')
        n = self.counts.total()
        if self._n_listed not in (None, n) and not self.damage:
            said = f'{METADATA} counts {shortened(str(self._n_listed))} messages'
            self.damage.append(f'{said}, there are {n}')
        self.topics = sorted(topics.values())
        if self.damage and not topics:
            raise ValueError('; '.join(self.damage).removeprefix(f'{path.name} '))

    def messages(self, topic: Topic) -> Iterator[Message]:
        """Yield the messages of a topic in order of receipt, up to any damage."""
        for file in self._files:
            with contextlib.suppress(DamageError):  # self.damage has it already.
                for other, at_ns, raw in _read_messages(file):
                    if other.name == topic.name:
                        yield at_ns, _to_cdr(raw, topic)

    def _files_of(self, folder: Path) -> list[Path]:
        """Return the files of a bag in the order of their numbers; note what its metadata says."""
        there = {file.name: file for file in folder.iterdir() if file.is_file()}
        packed = [name for name in there if name.endswith(PACKED)]
        if {name.removesuffix(PACKED) for name in packed} - there.keys():
            refuse(f'has {name_list(packed)}', f'unpacked files, zstd -d {folder}/*{PACKED}')
        names = [name for name in there if Path(name).suffix in _READERS]
        if not names:
            refuse('has no files of a bag', '.mcap or .db3')
        if len({re.sub(r'\d+', '', name) for name in names}) > 1:
            refuse(f'has files of several bags: {name_list(sorted(names))}', 'those of one')
        names.sort(key=lambda name: [int(number) for number in re.findall(r'\d+', name)])
        try:
            about = read_yaml(folder / METADATA) if METADATA in there else {}
            about = about.get(INFORMATION) or {}
            self.custom_data = dict(about.get('custom_data') or {})
            self._n_listed = about.get('message_count')
            paths = about.get('relative_file_paths') or names
            listed = {PurePath(path).name.removesuffix(PACKED) for path in paths}
        except (ValueError, TypeError, AttributeError) as error:
            why = shortened(str(error).removeprefix(f'{folder / METADATA}: '))
            raise ValueError(f'{METADATA} is broken ({why}): ros2 bag reindex mends it') from None
        if listed != {*names}:
            text = f'{METADATA} lists {name_list(sorted(listed))}, there are {name_list(names)}'
            self.damage.append(f'{text}: ros2 bag reindex {folder} lists all')
        return [there[name] for name in names]


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


def _read_database(path: Path) -> Iterator[Received]:
    """Yield the messages of a database of rosbag2 in the order in which they were written."""
    # Nothing is written beside a database that is immutable.
    uri = f'{path.absolute().as_uri()}?immutable=1'
    with contextlib.closing(sqlite3.connect(uri, uri=True)) as database:
        database.execute('PRAGMA writable_schema = ON')  # Else one that is cut off is not read.
        described: dict[str, list[str]] = {}
        with contextlib.suppress(sqlite3.OperationalError):  # Older bags have no definitions.
            columns = 'topic_type, encoding, encoded_message_definition'
            query = f'SELECT {columns} FROM message_definitions'
            described = {msgtype: texts for msgtype, *texts in database.execute(query)}
        topics = {
            number: Topic(name, msgtype, *described.get(msgtype, ('', '')))
            for number, name, msgtype in database.execute('SELECT id, name, type FROM topics')
        }
        query = 'SELECT topic_id, timestamp, data FROM messages'
        for number, at_ns, raw in database.execute(query):
            if number not in topics or not isinstance(raw, bytes):
                raise DamageError('is damaged, or has a message of no topic')
            yield topics[number], at_ns, raw


def _read_ros1(path: Path) -> Iterator[Received]:
    """Yield the messages of a bag of ROS 1 in order of receipt."""
    from rosbags import rosbag1

    with rosbag1.Reader(path) as reader:
        for topic, at_ns, raw in reader.messages():
            yield Topic(topic.topic, topic.msgtype, 'ros1msg', topic.msgdef.data), at_ns, raw


_READERS: dict[str, Callable[[Path], Iterator[Received]]] = {
    '.mcap': read_mcap,
    '.db3': _read_database,
    '.bag': _read_ros1,
}


def _read_messages(file: Path) -> Iterator[Received]:
    """Yield the messages of a file; a DamageError after those before the damage."""
    try:
        yield from _READERS[file.suffix](file)
    except DamageError:
        raise
    except Exception as error:  # A damaged file raises many kinds of error.
        repair = ', rosbag reindex may repair it' if file.suffix == '.bag' else ''
        why = shortened(' '.join(str(getattr(error, 'strerror', None) or error).split()))
        raise DamageError(f'is damaged ({why}){repair}') from None


def _to_cdr(raw: bytes, topic: Topic) -> bytes:
    """Return a message as ROS 2 serialises it, unpacked if it was compressed by itself."""
    from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

    if topic.encoding == 'ros1msg':
        return bytes(make_typestore(topic).ros1_to_cdr(raw, topic.msgtype))
    return bytes(DECOMPRESSORS['zstd'](raw, 0)) if raw.startswith(_ZSTD) else raw


@functools.lru_cache(maxsize=64)
def make_typestore(topic: Topic) -> Any:
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
        is_text = topic.encoding in ('ros2msg', 'ros1msg')
        types: Any = get_types_from_msg(topic.definition, topic.msgtype) if is_text else {}
        if HEADER in types:  # rosbags skips the number that only ROS 1 has
            constants, fields = types[HEADER]
            types[HEADER] = (constants, [field for field in fields if field[0] != 'seq'])
        store = get_typestore(Stores.EMPTY)
        store.register(types)
        store.get_msgdef(topic.msgtype)
    except Exception as error:
        store = get_typestore(Stores.LATEST)
        if topic.msgtype not in store.fielddefs:
            what = f'{quote_name(topic.name)} is {quote_name(topic.msgtype)}'
            why = f'no definition that can be read ({shortened(" ".join(str(error).split()))})'
            raise ValueError(f'{what}, of which the bag has {why}') from None
    return store
