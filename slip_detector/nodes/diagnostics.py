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

"""Publishes the detector's health on ``/diagnostics``."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node

from slip_detector.nodes.health import Status


class Diagnostics:
    """Publishes the statuses of a :class:`.Health`, named ``<node>: <part>``."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publisher = node.create_publisher(
            DiagnosticArray,
            '/diagnostics',
            10,
            event_callbacks=PublisherEventCallbacks(use_default_callbacks=False),
        )
        self._name = node.get_fully_qualified_name().lstrip('/')

    def destroy(self) -> None:
        """Destroy the publisher."""
        self._node.destroy_publisher(self._publisher)

    def publish(self, statuses: list[Status], hardware: str) -> None:
        """Publish all statuses, stamped with the current time."""
        array = DiagnosticArray()
        array.header.stamp = self._node.get_clock().now().to_msg()
        for status in statuses:
            array.status.append(
                DiagnosticStatus(
                    level=bytes([status.level]),
                    name=f'{self._name}: {status.name}',
                    message=status.message,
                    hardware_id=hardware,
                    values=[KeyValue(key=key, value=text) for key, text in status.values.items()],
                )
            )
        self._publisher.publish(array)
