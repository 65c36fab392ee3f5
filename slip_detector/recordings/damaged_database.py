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

"""Reads truncated SQLite databases of bags, up to the first missing page."""

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

from slip_detector.recordings.topics import Message, Topic


class DamagedDatabase:
    """A database that is truncated or damaged.

    Parameters
    ----------
    path
        The file, with whole pages only: SQLite reads an incomplete page as content.
    name
        Name of the file for messages, as ``path`` may be that of a copy.

    Attributes
    ----------
    topics : list of Topic
    lost : str
        Describes the damage, as far as known; empty if none was found so far.
    """

    def __init__(self, path: Path, name: str) -> None:
        self._path, self.name = path, name
        self.lost = ''
        self._names: dict[int, str] = {}
        self.topics = []
        definitions: dict[str, tuple[str, str]] = {}
        with contextlib.closing(self._connection()) as connection:
            with contextlib.suppress(sqlite3.Error):  # Older bags have no such table.
                query = 'SELECT topic_type, encoding, encoded_message_definition'
                for row in connection.execute(f'{query} FROM message_definitions'):
                    msgtype, encoding, text = map(str, row)
                    definitions[msgtype] = (encoding, text)
            try:
                # In place of a table a view could yield any number of rows.
                kinds = connection.execute(
                    "SELECT type FROM sqlite_master WHERE name IN ('topics', 'messages')"
                )
                if {kind for (kind,) in kinds} - {'table'}:
                    raise ValueError(f'{name}: is broken or not db3 (it has views)')
                for key, *row in connection.execute('SELECT id, name, type FROM topics'):
                    topic, msgtype = map(str, row)
                    self._names[key] = topic
                    self.topics.append(Topic(topic, msgtype, *definitions.get(msgtype, ('', ''))))
            except sqlite3.Error as error:
                raise ValueError(f'{name}: is broken or not db3 ({error})') from None

    def messages(self, topics: set[str]) -> Iterator[Message]:
        """Yield the messages of some topics in the order in which they were written."""
        self.lost = ''
        with contextlib.closing(self._connection()) as connection:
            try:
                query = 'SELECT topic_id, timestamp, data FROM messages NOT INDEXED ORDER BY id'
                for key, received_ns, raw in connection.execute(query):
                    topic = self._names.get(key)
                    if topic in topics and isinstance(raw, bytes) and isinstance(received_ns, int):
                        yield topic, received_ns, raw
            except sqlite3.Error:
                self.lost = f'is cut off or damaged, {self._path.stat().st_size} bytes are left'

    def _connection(self) -> sqlite3.Connection:
        """Open the database, even if it has fewer pages than its first page says."""
        place = f'file:{quote(str(self._path))}?immutable=1'
        try:
            connection = sqlite3.connect(place, uri=True)
            connection.execute('PRAGMA writable_schema = ON')
        except sqlite3.Error as error:
            raise ValueError(f'{self.name}: is broken or not db3 ({error})') from None
        connection.text_factory = lambda text: text.decode(errors='replace')
        return connection
