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

"""Serialises many rows at once as JointState messages (CDR)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.recordings.field_paths import FieldReader
from slip_detector.recordings.message_layout import begin_of, read_layout
from slip_detector.recordings.topics import JOINT_STATE

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]


class JointStateEncoder:
    """Serialises rows as JointState messages, which differ only in stamp and numbers.

    Parameters
    ----------
    typestore
        The type store of rosbags.
    frame_id
        Frame in the header of each message.
    names
        Names of the channels.

    Examples
    --------
    >>> from slip_detector.recordings.topics import standard_typestore
    >>> encoder = JointStateEncoder(standard_typestore(), 'tip', ['a', 'b'])
    >>> (raw,) = encoder.many(np.array([[4.3, 4.2]]), np.array([2_000_000_005]))
    >>> message = standard_typestore().deserialize_cdr(raw, JOINT_STATE)
    >>> message.header.stamp.nanosec, message.position.tolist()
    (5, [4.3, 4.2])
    """

    def __init__(self, typestore: Any, frame_id: str, names: Sequence[str]) -> None:
        types = typestore.types
        stamp = types['builtin_interfaces/msg/Time'](sec=0, nanosec=0)
        message = types[JOINT_STATE](
            header=types['std_msgs/msg/Header'](stamp=stamp, frame_id=frame_id),
            name=list(names),
            position=np.zeros(len(names)),
            velocity=np.empty(0),
            effort=np.empty(0),
        )
        raw = bytes(typestore.serialize_cdr(message, JOINT_STATE))
        layout = read_layout(raw, typestore, JOINT_STATE, FieldReader('position'))
        assert layout.stamp_bytes is not None
        self._template = np.frombuffer(raw, np.uint8)
        self._stamp_bytes, self._row_begin = layout.stamp_bytes, begin_of(layout.places[0, 0])

    def many(self, volts: Floats, stamps_ns: Stamps) -> list[bytes]:
        """Serialise rows.

        Parameters
        ----------
        volts : ndarray, shape (n, c)
            The rows.
        stamps_ns : ndarray of int, shape (n,)
            The stamp of each row.
        """
        n, length = len(volts), len(self._template)
        block = np.tile(self._template, (n, 1))
        parts = np.stack(np.divmod(stamps_ns, 1_000_000_000), axis=1)
        for begin, part in zip(self._stamp_bytes, parts.T, strict=True):
            block[:, begin : begin + 4] = part.astype('<u4')[:, np.newaxis].view(np.uint8)
        rows = np.ascontiguousarray(volts, dtype='<f8').view(np.uint8)
        block[:, self._row_begin : self._row_begin + rows.shape[1]] = rows
        content = block.tobytes()
        return [content[i : i + length] for i in range(0, n * length, length)]
