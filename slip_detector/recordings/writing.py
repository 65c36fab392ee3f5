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

"""Writes recordings as bags, npz or csv files, by the ending of the path."""

import contextlib
import csv
import decimal
import errno
import json
import os
import sqlite3
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from slip_detector.chain.samples import Samples
from slip_detector.parameters import refuse, whole_file, writable_folder
from slip_detector.recordings.bag_recording import BOOL, JOINT_STATE
from slip_detector.recordings.bag_storage import INFORMATION, METADATA, load_rosbags
from slip_detector.recordings.labels import ACCURACY, KIND
from slip_detector.recordings.messages import JointStateWriter

#: Name of rosbags for the storage of each ending.
PLUGINS = {'.mcap': 'MCAP', '.db3': 'SQLITE3'}

#: The topics of a bag and their types.
TOPICS = {'/voltages': JOINT_STATE, '/slip_truth': BOOL, '/platform_position': JOINT_STATE}

#: The serialised states of a Bool.
BOOLS = (b'\0\1\0\0\0', b'\0\1\0\0\1')


def write_recording(
    path: 'str | Path',
    pieces: Iterable[Samples],
    sample_rate_hz: float,
    channel_names: Sequence[str],
) -> None:
    """Write a recording that :func:`~slip_detector.recordings.open_recording` reads.

    Parameters
    ----------
    path
        The new file: .npz, .csv, .mcap or .db3. Without an ending it is the folder of a bag (MCAP
        with metadata.yaml, as ``ros2 bag record`` writes it). In bags the rows are on
        ``voltages``, the truth on ``slip_truth`` and the position on ``platform_position``.
    pieces
        The rows, at least one; the truth is in all pieces or in none.
    sample_rate_hz
        Rate of the rows; written to npz only.
    channel_names
        A name for each channel; not written to npz.

    Raises
    ------
    ValueError
        When the path exists already, has another ending or cannot be written; names it.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.recordings import open_recording, write_recording
    >>> rows = Samples(np.full((100, 2), 4.3), np.arange(100) * 10_000_000)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'trial.csv'
    ...     write_recording(path, [rows], sample_rate_hz=100.0, channel_names=['a', 'b'])
    ...     recording = open_recording(path)
    >>> recording.channel_names, round(recording.sample_rate_hz, 6), recording.has_truth
    (('a', 'b'), 100.0, False)
    """
    path, endings = Path(path), ('.npz', '.csv', *PLUGINS)
    if path.suffix not in ('', *endings):
        refuse(f'{path}: is {path.suffix}', f'{", ".join(endings)} or without ending')
    if path.exists():
        refuse(f'{path}: already exists', 'a new path')
    writable_folder(path.parent)
    with whole_file(path) as new:
        if path.suffix == '.npz':
            _write_npz(new, pieces, sample_rate_hz)
        elif path.suffix == '.csv':
            _write_csv(new, pieces, channel_names)
        else:
            _write_bag(new, pieces, channel_names)


def _write_csv(path: Path, pieces: Iterable[Samples], names: Sequence[str]) -> None:
    with open(path, 'w', newline='', encoding='utf-8') as file:
        lines = csv.writer(file)
        for k, piece in enumerate(pieces):
            truth = piece.truth
            if k == 0:
                lines.writerow(['time_s', *names, *([] if truth is None else ['slip'])])
            for i, (stamp_ns, row) in enumerate(zip(piece.stamps_ns, piece.volts, strict=True)):
                time_s = decimal.Decimal(int(stamp_ns)).scaleb(-9)
                label = [] if truth is None else [int(truth[i])]
                # A float is written so that it is read back to the same bits.
                lines.writerow([f'{time_s:f}', *row.tolist(), *label])


def _write_npz(path: Path, pieces: Iterable[Samples], sample_rate_hz: float) -> None:
    first, *others = pieces
    samples = first.then(*others)
    columns = zip(('volts', 'stamps_ns', 'slip', 'position_m'), samples, strict=False)
    arrays: dict[str, Any] = {key: part for key, part in columns if part is not None}
    np.savez(path, sample_rate_hz=sample_rate_hz, **arrays)


def _write_bag(path: Path, pieces: Iterable[Samples], names: Sequence[str]) -> None:
    """Write the folder of a bag or, if the path has an ending, only the file with its messages."""
    bag = BagWriter(path.with_suffix(''), names, ending=path.suffix or '.mcap')
    try:
        for piece in pieces:
            bag.write(piece)
        bag.close()
    except BaseException as error:
        bag.abort()
        if isinstance(error, sqlite3.Error):  # for example of a full disk
            raise OSError(str(error)) from None
        raise
    if path.suffix:
        os.replace(bag.path, path)


class BagWriter:
    """A bag that is written piece by piece; an MCAP has a chunk for each second.

    The rows are on ``voltages``, the truth on ``slip_truth`` and the position on
    ``platform_position``. The time of receipt of a message is its stamp.

    Parameters
    ----------
    folder
        The folder of the new bag.
    channel_names
        A name for each channel.
    frame_id
        Frame of the messages.
    ending
        .mcap or .db3.
    accuracy_s
        How exact the truth is, which is noted in ``metadata.yaml``.
    kind
        One of :data:`.labels.KINDS`, which is noted there too; '': none of them.

    Raises
    ------
    ValueError
        When rosbags is not installed.
    FileExistsError
        When the folder exists already.
    OSError
        When the folder cannot be made.

    Examples
    --------
    >>> import tempfile
    >>> from slip_detector.recordings import open_recording
    >>> volts, slip = np.full((100, 2), 4.3), np.arange(100) >= 50
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'trial'
    ...     bag = BagWriter(path, ['a', 'b'])
    ...     bag.write(Samples(volts, np.arange(100) * 10_000_000, slip))
    ...     bag.flush()  # can be read from here on, even if this process is killed
    ...     bag.close()
    ...     sum(int(piece.truth.sum()) for piece in open_recording(path).pieces())
    50
    """

    def __init__(
        self,
        folder: Path,
        channel_names: Sequence[str],
        frame_id: str = 'fingertip',
        ending: str = '.mcap',
        accuracy_s: float = 0.0,
        kind: str = '',
    ) -> None:
        rosbag2 = load_rosbags()
        from rosbags.typesys import Stores, get_typestore

        from slip_detector.recordings.bag_files import QUALITY, CheckedMcap

        self.path = folder / f'{folder.name}{ending}'
        self._rows = JointStateWriter(frame_id, channel_names)
        self._platform = JointStateWriter(frame_id, ['platform'])
        self._last: bool | None = None
        if folder.exists():
            raise FileExistsError(errno.EEXIST, 'already exists')
        plugins = rosbag2.StoragePlugin
        self._writer = rosbag2.Writer(folder, version=9, storage_plugin=plugins[PLUGINS[ending]])
        self._writer.STORAGE_PLUGINS = {**self._writer.STORAGE_PLUGINS, plugins.MCAP: CheckedMcap}
        self._writer.custom_data |= {ACCURACY: f'{accuracy_s:g}', KIND: kind}
        self._writer.open()
        # The accuracy and the kind are known even if this process is killed.
        document = json.dumps({INFORMATION: {'custom_data': self._writer.custom_data}})
        (folder / METADATA).write_text(document, encoding='utf-8')
        about: Any = {'typestore': get_typestore(Stores.ROS2_JAZZY)}
        about['offered_qos_profiles'] = [QUALITY]
        self._topics = {
            topic: self._writer.add_connection(topic, msgtype, **about)
            for topic, msgtype in TOPICS.items()
        }

    def put(self, topic: str, at_ns: int, raw: bytes) -> None:
        """Write a message.

        Raises
        ------
        OSError
            When the file cannot be written, or the time is negative, which MCAP cannot store.
        """
        if self.path.suffix == '.mcap' and at_ns < 0:
            raise OSError(errno.EINVAL, 'a stamp is negative, which MCAP has no room for')
        self._writer.write(self._topics[topic], at_ns, raw)

    def write(self, piece: Samples) -> None:
        """Write the next rows; all pieces have a truth, or none.

        Raises
        ------
        OSError
            As :meth:`put`.
        """
        truth = piece.truth
        for i, at_ns in enumerate(piece.stamps_ns.tolist()):
            # A state holds for the messages that are received after it.
            if truth is not None and truth[i] != self._last:
                self._last = bool(truth[i])
                self.put('/slip_truth', at_ns, BOOLS[self._last])
            if piece.position_m is not None:
                position = self._platform.serialize(at_ns, piece.position_m[i])
                self.put('/platform_position', at_ns, position)
            self.put('/voltages', at_ns, self._rows.serialize(at_ns, piece.volts[i]))

    def flush(self) -> None:
        """Pass all rows so far to the operating system, so that they survive a killed process.

        Only for MCAP.

        Raises
        ------
        OSError
            When the disk is full, for example.
        """
        self._writer.storage.flush()

    def close(self) -> None:
        """Write the index and the rest of ``metadata.yaml``.

        Raises
        ------
        OSError
            When these cannot be written. Flushed rows are kept; :meth:`abort` closes the file.
        """
        self._writer.close()

    def abort(self) -> None:
        """Close the file as it is, after a failed write."""
        # Closing writes the rest of the buffer, which may fail again.
        with contextlib.suppress(OSError, sqlite3.Error):
            self._writer.abort()
