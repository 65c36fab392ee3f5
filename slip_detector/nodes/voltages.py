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

"""Publishes the driver's samples, one by one or in batches."""

from array import array

import numpy as np
from numpy.typing import NDArray
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32MultiArray, MultiArrayDimension

from slip_detector.nodes.messages import sensor_qos
from slip_detector.recordings.messages import BATCH_LABELS, JointStateWriter


class Voltages:
    """Publishes samples on ``voltages``.

    Parameters
    ----------
    node
        The driver.
    frame_id
        Frame of the messages, if their type has one.
    samples_per_message
        1: each sample is a ``JointState`` with stamp and names. More: this many samples are a
        ``Float32MultiArray``, which has neither.
    """

    def __init__(self, node: Node, frame_id: str, samples_per_message: int) -> None:
        self._frame_id, self._per_message = frame_id, samples_per_message
        self._names: list[str] = []
        self._writer: JointStateWriter | None = None
        self._rows: list[NDArray[np.float64]] = []
        self._publisher = node.create_publisher(
            JointState if samples_per_message == 1 else Float32MultiArray,
            'voltages',
            sensor_qos(),
            event_callbacks=PublisherEventCallbacks(use_default_callbacks=False),
        )

    def get_subscription_count(self) -> int:
        """Return the number of subscribers."""
        return int(self._publisher.get_subscription_count())

    @property
    def completed_by_next(self) -> bool:
        """Whether the next sample completes a message, which is then published at once."""
        return len(self._rows) + 1 >= self._per_message

    def publish(self, stamp_ns: int, names: list[str], volts: NDArray[np.float64]) -> None:
        """Publish a sample, or keep it until its message is complete."""
        if self._per_message > 1:
            self._rows.append(volts)
            if len(self._rows) == self._per_message:
                self.flush()
            return
        if self._writer is None or names != self._names:
            self._names = names
            self._writer = JointStateWriter(self._frame_id, names)
        self._publisher.publish(self._writer.written(stamp_ns, volts))

    def flush(self) -> None:
        """Publish the samples kept so far, however few."""
        if not self._rows:
            return
        rows = np.array(self._rows, np.float32)
        self._rows = []
        message = Float32MultiArray(data=array('f', rows.tobytes()))
        samples, channels = rows.shape
        strides = (samples * channels, channels)
        message.layout.dim = [
            MultiArrayDimension(label=label, size=size, stride=stride)
            for label, size, stride in zip(BATCH_LABELS, rows.shape, strides, strict=True)
        ]
        self._publisher.publish(message)
