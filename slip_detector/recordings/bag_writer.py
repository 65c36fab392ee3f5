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


"""Writes rows into a bag, piece by piece, as the driver publishes them."""

import contextlib
import errno
import sqlite3
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from slip_detector.chain.samples import Samples
from slip_detector.recordings.bag_storage import load_rosbags
from slip_detector.recordings.mcap_chunks import write_checksums
from slip_detector.recordings.message_encoder import JointStateEncoder
from slip_detector.recordings.topics import BOOL, JOINT_STATE, standard_typestore

#: Version of the bag metadata for ROS 2 Jazzy and later.
BAG_VERSION = 9

#: Name of rosbags for the storage of each ending.
PLUGINS = {'.mcap': 'MCAP', '.db3': 'SQLITE3'}


class BagWriter:
    """A bag that is written piece by piece.

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
    ) -> None:
        rosbag2 = load_rosbags()
        self.path = folder / f'{folder.name}{ending}'
        self._store = store = standard_typestore()
        self._rows = JointStateEncoder(store, frame_id, channel_names)
        self._platform = JointStateEncoder(store, frame_id, ['platform'])
        self._bools = [
            bytes(store.serialize_cdr(store.types[BOOL](data=state), BOOL))
            for state in (False, True)
        ]
        self._samples_quality, self._states_quality = _qualities()
        self._truth_topic = self._position_topic = None
        self._last: bool | None = None
        plugin = rosbag2.StoragePlugin[PLUGINS[ending]]
        try:
            self._writer = rosbag2.Writer(folder, version=BAG_VERSION, storage_plugin=plugin)
            with _as_os_errors():
                self._writer.open()
        except rosbag2.WriterError:
            raise FileExistsError(errno.EEXIST, 'already exists') from None
        with _as_os_errors():
            self._voltages = self._topic('/voltages', JOINT_STATE, self._samples_quality)

    def _topic(self, name: str, msgtype: str, quality: Any) -> Any:
        return self._writer.add_connection(
            name, msgtype, typestore=self._store, offered_qos_profiles=[quality]
        )

    def write(self, piece: Samples) -> None:
        """Write the next rows; all pieces have a truth, or none.

        Raises
        ------
        OSError
            When the file cannot be written, or a stamp is negative, which MCAP cannot store.
        """
        n = len(piece.volts)
        if self.path.suffix == '.mcap' and np.any(piece.stamps_ns < 0):
            raise OSError(errno.EINVAL, 'a stamp is negative, which MCAP has no room for')
        truth = [None] * n if piece.truth is None else piece.truth.tolist()
        positions: list[bytes | None] = [None] * n
        if piece.truth is not None and self._truth_topic is None:
            self._truth_topic = self._topic('/slip_truth', BOOL, self._states_quality)
        if piece.position_m is not None:
            column = piece.position_m[:, np.newaxis]
            positions = [*self._platform.many(column, piece.stamps_ns)]
            if self._position_topic is None:
                self._position_topic = self._topic(
                    '/platform_position', JOINT_STATE, self._samples_quality
                )
        rows = self._rows.many(piece.volts, piece.stamps_ns)
        with _as_os_errors():
            for stamp_ns, row, slip, position in zip(
                piece.stamps_ns.tolist(), rows, truth, positions, strict=True
            ):
                # A state holds for the messages that are received after it.
                if slip is not None and slip != self._last:
                    self._last = slip
                    self._writer.write(self._truth_topic, stamp_ns, self._bools[slip])
                if position is not None:
                    self._writer.write(self._position_topic, stamp_ns, position)
                self._writer.write(self._voltages, stamp_ns, row)

    def flush(self) -> None:
        """Pass all rows so far to the operating system, so that they survive a killed process.

        Only for MCAP: the rows since the last call become a chunk.

        Raises
        ------
        OSError
            When the disk is full, for example.
        """
        storage = self._writer.storage
        if storage.chunk.msgs:
            storage.close_chunk()
        storage.bio.flush()

    def close(self) -> None:
        """Write the index and ``metadata.yaml``, and give each chunk of an MCAP its checksum.

        Raises
        ------
        OSError
            When these cannot be written. Flushed rows are kept.
        """
        try:
            with _as_os_errors():
                self._writer.close()
            if self.path.suffix == '.mcap':
                write_checksums(self.path)
        except OSError:
            self.abort()
            raise

    def abort(self) -> None:
        """Close the file as it is, after a failed write."""
        # Closing writes the rest of the buffer, which may fail again.
        with contextlib.suppress(OSError, sqlite3.Error):
            self._writer.abort()


@contextlib.contextmanager
def _as_os_errors() -> Iterator[None]:
    """Turn errors of a database, for example of a full disk, into OSError as of other files."""
    try:
        yield
    except sqlite3.Error as error:
        raise OSError(str(error)) from None


def _qualities() -> tuple[Any, Any]:
    """Return the driver's quality of service for samples and for states.

    ``ros2 bag play`` publishes with it, so that a late subscriber gets the last state.
    """
    from rosbags import interfaces

    for_ever = interfaces.QosTime(9223372036, 854775807)
    sample = interfaces.Qos(
        history=interfaces.QosHistory.KEEP_LAST,
        depth=100,
        reliability=interfaces.QosReliability.BEST_EFFORT,
        durability=interfaces.QosDurability.VOLATILE,
        deadline=for_ever,
        lifespan=for_ever,
        liveliness=interfaces.QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=for_ever,
        avoid_ros_namespace_conventions=False,
    )
    state = sample._replace(
        depth=1,
        reliability=interfaces.QosReliability.RELIABLE,
        durability=interfaces.QosDurability.TRANSIENT_LOCAL,
    )
    return sample, state
