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

"""Bags that tests write message by message, and rows to compare with."""

import numpy as np
from rosbags import rosbag1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from slip_detector.chain.samples import Samples
from slip_detector.recordings import write_recording

#: Made once, as it compiles code for each type that is used.
STORE = get_typestore(Stores.ROS2_JAZZY)
NAMES = ('left', 'right', 'tip')
JOINT_STATE = 'sensor_msgs/msg/JointState'
PLUGINS = [StoragePlugin.MCAP, StoragePlugin.SQLITE3]
ENDINGS = ['.mcap', '.db3', '', '.npz', '.csv']
START_NS = 1_700_000_000_123_456_789


def stamps(n):
    return START_NS + np.rint(np.arange(n) * 1e9 / 380.0).astype(np.int64)


def rows(n=600, channels=3, seed=0, truth=True):
    rng = np.random.default_rng(seed)
    volts = 4.3 + 1e-3 * rng.standard_normal((n, channels))
    slip = (np.arange(n) // 100) % 2 == 1
    return Samples(volts, stamps(n), slip if truth else None)


def save(path, written):
    """Write rows as a recording; return its path."""
    write_recording(path, [written], 380.0, NAMES)
    return path


def gathered(recording):
    first, *others = recording.pieces()
    return first.then(*others)


def check_same(read, written):
    """Check that rows are the same to the bit."""
    assert read.volts.tobytes() == written.volts.tobytes()
    np.testing.assert_array_equal(read.stamps_ns, written.stamps_ns)
    np.testing.assert_array_equal(read.truth, written.truth, strict=True)


class Bag:
    """A bag that a test writes message by message, of ROS 1 if its name ends in ``.bag``."""

    def __init__(self, path, plugin=StoragePlugin.MCAP, definitions=()):
        self._is_ros1 = path.suffix == '.bag'
        self.store = get_typestore(Stores.ROS2_JAZZY) if definitions else STORE
        self.writer = Writer(path, version=9, storage_plugin=plugin)
        if self._is_ros1:
            self.store, self.writer = get_typestore(Stores.ROS1_NOETIC), rosbag1.Writer(path)
        for name, text in definitions:
            self.store.register(get_types_from_msg(text, name))
        self.path = path
        self._connections = {}

    def __enter__(self):
        self.writer.open()
        return self

    def __exit__(self, *_):
        self.writer.close()

    def make(self, msgtype, **fields):
        return self.store.types[msgtype](**fields)

    def header(self, stamp_ns):
        sec, nanosec = divmod(int(stamp_ns), 1_000_000_000)
        stamp = self.make('builtin_interfaces/msg/Time', sec=sec, nanosec=nanosec)
        number = {'seq': 7} if self._is_ros1 else {}
        return self.make('std_msgs/msg/Header', stamp=stamp, frame_id='tip', **number)

    def joints(self, stamp_ns, position, names=NAMES):
        nothing = np.empty(0)
        return self.make(
            JOINT_STATE,
            header=self.header(stamp_ns),
            name=list(names),
            position=np.array(position, dtype=np.float64),
            velocity=nothing,
            effort=nothing,
        )

    def write_rows(self, written, namespace=''):
        """Write volts, and the truth where it changes, received at their stamps."""
        for k, (stamp_ns, row) in enumerate(zip(written.stamps_ns, written.volts, strict=True)):
            if k == 0 or written.truth[k] != written.truth[k - 1]:
                slip = self.make('std_msgs/msg/Bool', data=bool(written.truth[k]))
                self.write(f'{namespace}/slip_truth', slip, stamp_ns)
            self.write(f'{namespace}/voltages', self.joints(stamp_ns, row), stamp_ns)

    def write(self, topic, message, received_ns):
        msgtype = message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self.writer.add_connection(
                topic, msgtype, typestore=self.store
            )
        serialize = self.store.serialize_ros1 if self._is_ros1 else self.store.serialize_cdr
        raw = serialize(message, msgtype)
        self.writer.write(self._connections[topic], int(received_ns), bytes(raw))
