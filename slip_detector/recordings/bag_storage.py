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
import importlib
import re
import shutil
import sqlite3
import sys
import tempfile
import weakref
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path, PurePath
from typing import Any

from slip_detector.parameters.fields import name_list, quote_name, refuse, shortened
from slip_detector.parameters.yaml_files import read_yaml
from slip_detector.recordings.mcap import DamageError, Received, Topic, mcap_messages

#: The file that makes a folder a bag.
METADATA = 'metadata.yaml'

#: The only key of ``metadata.yaml``.
INFORMATION = 'rosbag2_bagfile_information'

#: Ending of a file that was compressed as a whole.
PACKED = '.zstd'

#: Endings of the files of a bag; .bag is that of ROS 1.
BAG_ENDINGS = ('.mcap', '.db3', '.bag', PACKED)

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
        files, listed_messages = self._described(path) if path.is_dir() else ([path], None)
        self.counts, topics = Counter[str](), dict[str, Topic]()
        self._files = [self._unpacked(file) for file in files]
        for source, file in zip(files, self._files, strict=True):
            try:
                for topic, _, _ in _received(file):
                    self.counts[topic.name] += 1
                    topics[topic.name] = topic
            except DamageError as error:
                self.damage.append(f'{source.name} {error}')
            # A -wal or a -journal.
            for journal in source.parent.glob(f'{glob.escape(source.name)}-*l'):
                mend = f'sqlite3 {source} "PRAGMA wal_checkpoint" takes it in'
                self.damage.append(f'{journal.name} beside it is not read: {mend}')
        if listed_messages not in (None, n := self.counts.total()) and not self.damage:
            said = f'{METADATA} counts {shortened(str(listed_messages))} messages'
            self.damage.append(f'{said}, there are {n}')
        self.topics = sorted(topics.values())
        if self.damage and not topics:
            raise ValueError('; '.join(self.damage).removeprefix(f'{path.name} '))

    def messages(self, topic: Topic) -> Iterator[Message]:
        """Yield the messages of a topic in order of receipt, up to any damage."""
        for file in self._files:
            with contextlib.suppress(DamageError):  # self.damage has it already.
                for other, at_ns, raw in _received(file):
                    if other.name == topic.name:
                        yield at_ns, _cdr(raw, topic)

    def _described(self, folder: Path) -> tuple[list[Path], Any]:
        """Return the files of a bag in order, and the number of messages by its metadata."""
        # Of a file and what it was compressed to, the file comes first.
        there: dict[str, Path] = {}
        for file in sorted(folder.iterdir()):
            if Path(name := file.name.removesuffix(PACKED)).suffix in _READERS and file.is_file():
                there.setdefault(name, file)
        about, listed = dict[str, Any](), list[str]()
        try:
            if (folder / METADATA).exists():
                about = read_yaml(folder / METADATA).get(INFORMATION) or {}
                self.custom_data = dict(about.get('custom_data') or {})
                paths = about.get('relative_file_paths') or ()
                listed = [PurePath(path).name.removesuffix(PACKED) for path in paths]
        except (ValueError, TypeError, AttributeError) as error:
            why = shortened(str(error).removeprefix(f'{folder / METADATA}: '))
            self.damage.append(f'{METADATA} is not used ({why})')
            about = {}
        if not listed and len({re.sub(r'\d+', '', name) for name in there}) > 1:
            refuse(f'has files of several bags: {name_list(sorted(there))}', 'those of one')
        if missing := name_list([name for name in listed if name not in there]):
            self.damage.append(f'{METADATA} lists {missing}, which is not there')
        if listed and (others := name_list([name for name in there if name not in listed])):
            text = f'{METADATA} does not list {others}, so that it is left out'
            self.damage.append(f'{text}: ros2 bag reindex {folder} lists all')
        read = [name for name in there if not listed or name in listed]
        if not read:
            self.damage.append('has no files of a bag, allowed: .mcap or .db3')
        read.sort(key=lambda name: [int(number) for number in re.findall(r'\d+', name)])
        return [there[name] for name in read], about.get('message_count')

    def _unpacked(self, file: Path) -> Path:
        """Return a file, or an unpacked copy of one that was compressed as a whole."""
        if file.suffix != PACKED:
            return file
        folder = Path(tempfile.mkdtemp(prefix='slip_detector_'))
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        copy = folder / file.stem
        try:
            with _zstd().open(file, 'rb') as packed, open(copy, 'wb') as new:
                shutil.copyfileobj(packed, new)
        except (EOFError, _zstd().ZstdError) as error:
            self.damage.append(f'{file.name} is damaged ({error})')
        return copy


def _zstd() -> Any:
    """Import the module that unpacks zstd; it comes with rosbags."""
    name = 'compression.zstd' if sys.version_info >= (3, 14) else 'backports.zstd'
    return importlib.import_module(name)


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


def _database_messages(path: Path) -> Iterator[Received]:
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
            if number not in topics:
                raise DamageError('has a message of no topic')
            if not isinstance(at_ns, int) or not isinstance(raw, bytes):
                raise DamageError('is damaged')
            yield topics[number], at_ns, raw
        # Pages and the index of times are checked so; what is in a message has no checksum.
        ((verdict,),) = database.execute('PRAGMA integrity_check(1)')
        if verdict != 'ok':
            raise DamageError(f'is damaged ({shortened(verdict)})')


def _ros1_messages(path: Path) -> Iterator[Received]:
    """Yield the messages of a bag of ROS 1 in order of receipt."""
    from rosbags import rosbag1

    with rosbag1.Reader(path) as reader:
        for topic, at_ns, raw in reader.messages():
            yield Topic(topic.topic, topic.msgtype, 'ros1msg', topic.msgdef.data), at_ns, raw


_READERS: dict[str, Callable[[Path], Iterator[Received]]] = {
    '.mcap': mcap_messages,
    '.db3': _database_messages,
    '.bag': _ros1_messages,
}


def _received(file: Path) -> Iterator[Received]:
    """Yield the messages of a file; a DamageError after those before the damage."""
    if file.suffix not in _READERS:
        raise DamageError(f'is none of {", ".join(_READERS)}')
    try:
        yield from _READERS[file.suffix](file)
    except DamageError:
        raise
    except Exception as error:  # A damaged file raises many kinds of error.
        repair = ', rosbag reindex may repair it' if file.suffix == '.bag' else ''
        why = shortened(' '.join(str(getattr(error, 'strerror', None) or error).split()))
        raise DamageError(f'is damaged ({why}){repair}') from None


def _cdr(raw: bytes, topic: Topic) -> bytes:
    """Return a message as ROS 2 serialises it, unpacked if it was compressed by itself."""
    if topic.encoding == 'ros1msg':
        return bytes(typestore_of(topic).ros1_to_cdr(raw, topic.msgtype))
    return bytes(_zstd().decompress(raw)) if raw.startswith(_ZSTD) else raw


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
