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
