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

import csv
import os
import sqlite3
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from slip_detector.chain.samples import Samples
from slip_detector.parameters.files import whole_file, write_errors_of
from slip_detector.recordings.bag_storage import load_rosbags
from slip_detector.recordings.mcap_chunks import write_checksums
from slip_detector.recordings.message_encoder import JointStateEncoder
from slip_detector.recordings.topics import BOOL, JOINT_STATE, standard_typestore

#: Version of the metadata that ROS 2 Jazzy and later read.
BAG_VERSION = 9

_NPZ_KEYS = ('volts', 'stamps_ns', 'slip', 'position_m')

_PLUGINS = {'.mcap': 'MCAP', '.db3': 'SQLITE3'}


def write_recording(
    path: 'str | Path',
    pieces: Iterable[Samples],
    sample_rate_hz: float,
    channel_names: Sequence[str],
    frame_id: str = 'fingertip',
) -> None:
    """Write a recording that :func:`~slip_detector.recordings.open_recording` reads.

    Parameters
    ----------
    path
        The new file: .npz, .csv, .mcap or .db3. Without an ending it is the folder of a bag (MCAP
        with metadata.yaml, as ``ros2 bag record`` writes it). In bags the rows are on
        ``voltages``, the truth on ``slip_truth`` and the position on ``platform_position``.
    pieces
        The rows, at least one, with the truth in all pieces or in none.
    sample_rate_hz
        Rate of the rows; it is written to npz only.
    channel_names
        A name for each channel; they are not written to npz.
    frame_id
        Frame of the messages in a bag.

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
    path = Path(path)
    writers: dict[str, Callable[[Path], None]] = {
        '.npz': lambda to: _write_npz(to, pieces, sample_rate_hz),
        '.csv': lambda to: _write_csv(to, pieces, channel_names),
        **{
            ending: lambda to: _write_bag(to, pieces, channel_names, frame_id)
            for ending in ('', *_PLUGINS)
        },
    }
    if path.suffix not in writers:
        raise ValueError(
            f'{path}: is {path.suffix}, allowed: .npz, .csv, .mcap, .db3 or without ending'
        )
    if path.exists():
        raise ValueError(f'{path}: is there already, allowed: a new path')
    with write_errors_of(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as new:
        writers[path.suffix](new)


def _write_csv(path: Path, pieces: Iterable[Samples], names: Sequence[str]) -> None:
    first = True
    with open(path, 'w', newline='', encoding='utf-8') as file:
        lines = csv.writer(file)
        for piece in pieces:
            truth: list[list[int]] = [[] for _ in piece.volts]
            if piece.truth is not None:
                truth = [[int(slip)] for slip in piece.truth]
            if first:
                lines.writerow(['time_s', *names, *(['slip'] if piece.truth is not None else [])])
                first = False
            for stamp_ns, row, slip in zip(
                piece.stamps_ns.tolist(), piece.volts.tolist(), truth, strict=True
            ):
                sign, (seconds, rest) = '-' * (stamp_ns < 0), divmod(abs(stamp_ns), 1_000_000_000)
                # repr writes a float so that it is read back to the bit.
                lines.writerow([f'{sign}{seconds}.{rest:09d}', *map(repr, row), *slip])


def _write_npz(path: Path, pieces: Iterable[Samples], sample_rate_hz: float) -> None:
    columns = {
        key: [column for column in parts if column is not None]
        for key, parts in zip(_NPZ_KEYS, zip(*pieces, strict=True), strict=True)
    }
    arrays: dict[str, Any] = {key: np.concatenate(p) for key, p in columns.items() if p}
    np.savez(path, sample_rate_hz=sample_rate_hz, **arrays)


def _write_bag(path: Path, pieces: Iterable[Samples], names: Sequence[str], frame_id: str) -> None:
    """Write the folder of a bag, or only the file with its messages."""
    rosbag2 = load_rosbags()
    plugin = rosbag2.StoragePlugin[_PLUGINS.get(path.suffix, 'MCAP')]
    folder = path.with_suffix('')
    try:
        with rosbag2.Writer(folder, version=BAG_VERSION, storage_plugin=plugin) as writer:
            _write_messages(writer, pieces, names, frame_id)
    except sqlite3.Error as error:  # where other files raise an OSError, as on a full disk
        raise OSError(str(error)) from None
    if plugin is rosbag2.StoragePlugin.MCAP:
        write_checksums(folder / f'{folder.name}.mcap')
    if path.suffix:
        os.replace(folder / f'{folder.name}{path.suffix}', path)


def _write_messages(
    writer: Any, pieces: Iterable[Samples], names: Sequence[str], frame_id: str
) -> None:
    """Write the topics as the driver publishes them; messages are received at their stamps."""
    store = standard_typestore()
    samples, states = _qualities()
    voltages = writer.add_connection(
        '/voltages', JOINT_STATE, typestore=store, offered_qos_profiles=[samples]
    )
    rows = JointStateEncoder(store, frame_id, names)
    platform = JointStateEncoder(store, frame_id, ['platform'])
    bools = [
        bytes(store.serialize_cdr(store.types[BOOL](data=state), BOOL)) for state in (False, True)
    ]
    truth_topic = position_topic = None
    last: bool | None = None
    for piece in pieces:
        n = len(piece.volts)
        stamps_ns = piece.stamps_ns.tolist()
        truth = [None] * n if piece.truth is None else piece.truth.tolist()
        positions: list[bytes | None] = [None] * n
        if piece.truth is not None and truth_topic is None:
            truth_topic = writer.add_connection(
                '/slip_truth', BOOL, typestore=store, offered_qos_profiles=[states]
            )
        if piece.position_m is not None:
            positions = [*platform.many(piece.position_m[:, np.newaxis], piece.stamps_ns)]
            if position_topic is None:
                position_topic = writer.add_connection(
                    '/platform_position',
                    JOINT_STATE,
                    typestore=store,
                    offered_qos_profiles=[samples],
                )
        for stamp_ns, row, slip, position in zip(
            stamps_ns, rows.many(piece.volts, piece.stamps_ns), truth, positions, strict=True
        ):
            # A state holds for the messages that are received after it.
            if slip is not None and slip != last:
                last = slip
                writer.write(truth_topic, stamp_ns, bools[slip])
            if position is not None:
                writer.write(position_topic, stamp_ns, position)
            writer.write(voltages, stamp_ns, row)


def _qualities() -> tuple[Any, Any]:
    """Return the quality of service that the driver has for samples and for states.

    ``ros2 bag play`` offers it again, so that a late subscriber gets the last state.
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
