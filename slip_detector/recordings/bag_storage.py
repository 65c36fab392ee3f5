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

from slip_detector.chain.stamp_rules import SEVERAL
from slip_detector.parameters import name_list, quote_name, read_yaml, refuse, shortened
from slip_detector.recordings.mcap import BagFile, DamageError, Received, Topic, messages_of

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

#: Largest step of the time of receipt from message to message; a larger step is an error of the
#: time, unless several messages in a row have it.
FAR_NS = 86_400_000_000_000

#: Number of messages whose median time of receipt is taken to be right.
FIRST_TIMES = 9

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
    doubts : list of str
        One line for each reason why damage may go unseen, or why a part may not be wanted.
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
        self.damage, self.doubts = list[str](), list[str]()
        self.custom_data: dict[str, Any] = {}
        listed, n_listed = self._read_metadata(path if path.is_dir() else path.parent)
        if path.is_dir():
            files = self._files(path, listed)
        else:  # What is beside a single file is no part of it.
            files, n_listed, self.damage, self.custom_data = [path], None, [], {}
            if path.name in listed and len(listed) > 1:
                what = f'one of the {len(listed)} files of a bag, read as a whole by its folder'
                self.doubts.append(f'{path.name}: {what}')
        self.counts = Counter[str]()
        self._files_read: list[BagFile] = []
        topics, n, times_ns = dict[str, Topic](), 0, list[int]()
        for source in files:
            file, counts = BagFile(self._plain(source)), Counter[int]()
            try:
                for channel, at_ns, _ in _messages_of(file):
                    counts[channel] += 1
                    if len(times_ns) < FIRST_TIMES and at_ns < 2**63:
                        times_ns.append(at_ns)
            except DamageError as error:
                self.damage.append(f'{source.name} {error}')
            # A -wal or a -journal.
            for journal in source.parent.glob(f'{glob.escape(source.name)}-*l'):
                mend = f'sqlite3 {source} "PRAGMA wal_checkpoint" takes it in'
                self.damage.append(f'{journal.name} beside it is not read: {mend}')
            if file.doubts:
                self.doubts.append(f'{source.name}: {file.doubts}')
            if nameless := sum(counts[key] for key in counts.keys() - file.topics.keys()):
                self.damage.append(f'{source.name} has {nameless} messages of no topic')
            topics |= {topic.name: topic for key, topic in file.topics.items() if counts[key]}
            self.counts.update({topic.name: counts[key] for key, topic in file.topics.items()})
            self._files_read.append(file)
            n += counts.total()
        if n_listed not in (None, n) and not self.damage:
            said = f'{METADATA} counts {shortened(str(n_listed))} messages'
            self.damage.append(f'{said}, there are {n}')
        self._begin_ns = sorted(times_ns)[(len(times_ns) - 1) // 2] if times_ns else 0
        self.topics = sorted(topics.values())
        if self.damage and not self.topics:
            raise ValueError('; '.join(self.damage))

    def messages(self, topic: Topic) -> Iterator[Message]:
        """Yield the messages of a topic in order of receipt, up to any damage.

        A time of receipt that is always 0, beyond 64 bits or far from all others is wrong: it
        becomes the time of the message before plus a nanosecond, so that the order is right.
        """
        last_ns, far, zeros = self._begin_ns, 0, 0
        for file in self._files_read:
            wanted = {key for key, other in file.topics.items() if other.name == topic.name}
            with contextlib.suppress(DamageError):  # self.damage has it already.
                for channel, at_ns, raw in _messages_of(file):
                    far = far + 1 if abs(at_ns - last_ns) > FAR_NS else 0
                    zeros = zeros + 1 if at_ns == 0 else 0  # Simulated time begins with some.
                    wrong = zeros > SEVERAL or at_ns >= 2**63 or 0 < far < SEVERAL
                    last_ns = last_ns + 1 if wrong else at_ns
                    if channel in wanted:
                        yield last_ns, _cdr(raw, topic)

    def _read_metadata(self, folder: Path) -> tuple[list[str], Any]:
        """Return the names of the files and the number of messages by ``metadata.yaml``."""
        if not (folder / METADATA).exists():
            return [], None
        try:
            document = read_yaml(folder / METADATA).get(INFORMATION) or {}
            self.custom_data = dict(document.get('custom_data') or {})
            names = [PurePath(name).name for name in document.get('relative_file_paths') or ()]
            return names, document.get('message_count')
        except (ValueError, TypeError, AttributeError) as error:
            why = shortened(str(error).removeprefix(f'{folder / METADATA}: '))
            self.damage.append(f'{METADATA} is not used ({why})')
            return [], None

    def _files(self, folder: Path, listed: list[str]) -> list[Path]:
        """Return the files of a bag in the order of their numbers."""
        there: dict[str, Path] = {}
        for file in sorted(folder.iterdir()):  # A file comes before what it was compressed to.
            if Path(name := file.name.removesuffix(PACKED)).suffix in _READERS and file.is_file():
                there.setdefault(name, file)
        wanted = [name.removesuffix(PACKED) for name in listed] or list(there)
        if not listed and len({re.sub(r'\d+', '', name) for name in there}) > 1:
            refuse(f'has files of several bags: {name_list(sorted(there))}', 'those of one')
        if missing := name_list([name for name in wanted if name not in there]):
            self.damage.append(f'{METADATA} lists {missing}, which is not there')
        if unlisted := name_list([name for name in there if name not in wanted]):
            text = f'{METADATA} does not list {unlisted}, so that it is left out'
            self.damage.append(f'{text}: ros2 bag reindex {folder} lists all')
        if not there.keys() & {*wanted}:
            self.damage.append('has no files of a bag, allowed: .mcap or .db3')
        numbers = {name: [int(n) for n in re.findall(r'\d+', name)] for name in there}
        return [there[name] for name in sorted(there, key=numbers.__getitem__) if name in wanted]

    def _plain(self, file: Path) -> Path:
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


def _database_messages(file: BagFile) -> Iterator[Received]:
    """Yield the messages of a database of rosbag2 in the order in which they were written."""
    # Nothing is written beside a database that is immutable.
    uri = f'{file.path.absolute().as_uri()}?immutable=1'
    with contextlib.closing(sqlite3.connect(uri, uri=True)) as database:
        database.execute('PRAGMA writable_schema = ON')  # Else one that is cut off is not read.
        described: dict[str, list[str]] = {}
        with contextlib.suppress(sqlite3.OperationalError):  # Older bags have no definitions.
            columns = 'topic_type, encoding, encoded_message_definition'
            query = f'SELECT {columns} FROM message_definitions'
            described = {msgtype: texts for msgtype, *texts in database.execute(query)}
        for key, name, msgtype in database.execute('SELECT id, name, type FROM topics'):
            file.topics[key] = Topic(name, msgtype, *described.get(msgtype, ('', '')))
        for row in database.execute('SELECT topic_id, timestamp, data FROM messages'):
            if [*map(type, row)] != [int, int, bytes]:
                raise DamageError('is damaged')
            yield row
        # Pages and the index of times are checked so; what is in a message has no checksum.
        ((verdict,),) = database.execute('PRAGMA integrity_check(1)')
        if verdict != 'ok':
            raise DamageError(f'is damaged ({shortened(verdict)})')


def _ros1_messages(file: BagFile) -> Iterator[Received]:
    """Yield the messages of a bag of ROS 1 in order of receipt."""
    from rosbags import rosbag1

    with rosbag1.Reader(file.path) as reader:
        for topic in reader.connections:
            definition = topic.msgdef.data
            file.topics[topic.id] = Topic(topic.topic, topic.msgtype, 'ros1msg', definition)
        for topic, at_ns, raw in reader.messages():
            yield topic.id, at_ns, raw


_READERS: dict[str, Callable[[BagFile], Iterator[Received]]] = {
    '.mcap': messages_of,
    '.db3': _database_messages,
    '.bag': _ros1_messages,
}


def _messages_of(file: BagFile) -> Iterator[Received]:
    """Yield the messages of a file; a DamageError after those before the damage."""
    if file.path.suffix not in _READERS:
        raise DamageError(f'is none of {", ".join(_READERS)}')
    try:
        yield from _READERS[file.path.suffix](file)
    except DamageError:
        raise
    except Exception as error:  # A damaged file raises many kinds of error.
        repair = ', rosbag reindex may repair it' if file.path.suffix == '.bag' else ''
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
