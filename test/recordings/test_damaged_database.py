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

"""Damaged databases: the messages before the first missing page are read."""

import contextlib
import sqlite3

import pytest

from slip_detector.recordings.damaged_database import DamagedDatabase
from slip_detector.recordings.topics import Topic

PAGE = 4096
N = 200

#: The page of the tables' names, and that of the topics.
PAGES_OF_TABLES = 2


def database(path, definitions=True):
    with contextlib.closing(sqlite3.connect(path)) as connection, connection:
        connection.execute(f'PRAGMA page_size = {PAGE}')
        connection.execute('CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT)')
        connection.execute(
            'CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, '
            'timestamp INTEGER, data BLOB)'
        )
        if definitions:
            connection.execute(
                'CREATE TABLE message_definitions (topic_type TEXT, encoding TEXT, '
                'encoded_message_definition TEXT)'
            )
            connection.execute(
                "INSERT INTO message_definitions VALUES ('a/msg/A', 'ros2msg', 'float64 a')"
            )
        connection.execute("INSERT INTO topics VALUES (1, '/voltages', 'a/msg/A')")
        connection.execute("INSERT INTO topics VALUES (2, '/other', 'a/msg/B')")
        connection.executemany('INSERT INTO messages VALUES (?, ?, ?, ?)', rows())
    return path


def rows():
    return [(k + 1, 1 + k % 2, 1000 + k, bytes([k]) * 100) for k in range(N)]


def wanted(topic_id, name):
    return [(name, at, raw) for _, key, at, raw in rows() if key == topic_id]


def test_topics_and_messages_are_read_in_their_order(tmp_path):
    damaged = DamagedDatabase(database(tmp_path / 'a.db3'), 'a.db3')
    assert damaged.topics == [
        Topic('/voltages', 'a/msg/A', 'ros2msg', 'float64 a'),
        Topic('/other', 'a/msg/B', '', ''),
    ]
    assert list(damaged.messages({'/voltages'})) == wanted(1, '/voltages')
    assert list(damaged.messages({'/other'})) == wanted(2, '/other')
    assert not damaged.lost


def test_an_older_bag_has_no_definitions(tmp_path):
    damaged = DamagedDatabase(database(tmp_path / 'a.db3', definitions=False), 'a.db3')
    assert damaged.topics[0] == Topic('/voltages', 'a/msg/A', '', '')


def test_whatever_pages_are_missing_a_beginning_is_read(tmp_path):
    content = database(tmp_path / 'whole.db3').read_bytes()
    path, counts = tmp_path / 'cut.db3', []
    for pages in range(len(content) // PAGE):
        path.write_bytes(content[: pages * PAGE])
        if pages < PAGES_OF_TABLES:
            with pytest.raises(ValueError, match=r'^a\.db3: is broken or not db3'):
                DamagedDatabase(path, 'a.db3')
            continue
        damaged = DamagedDatabase(path, 'a.db3')
        read = list(damaged.messages({'/voltages', '/other'}))
        every = [(('/voltages', '/other')[key - 1], at, raw) for _, key, at, raw in rows()]
        assert read == every[: len(read)]
        assert damaged.lost == f'is cut off or damaged, {pages * PAGE} bytes are left'
        counts.append(len(read))
    assert counts == sorted(counts)
    assert counts[0] == 0 < counts[-1] < N


def test_what_is_no_database_is_refused(tmp_path):
    (tmp_path / 'a.db3').write_bytes(b'\x89MCAP0\r\n' * 1000)
    with pytest.raises(ValueError, match=r'^b\.db3: is broken or not db3'):
        DamagedDatabase(tmp_path / 'a.db3', 'b.db3')
