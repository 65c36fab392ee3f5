"""The timers of a node, by name."""

from collections.abc import Callable

from rclpy.clock import Clock
from rclpy.node import Node
from rclpy.timer import Timer


class Timers:
    """Timers of a node that are started again one by one: the others keep their time.

    It is true while there are any.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._timers: dict[str, Timer] = {}

    def __bool__(self) -> bool:
        return bool(self._timers)

    def start(self, name: str, period_s: float, call: Callable[[], None], clock: Clock) -> None:
        """Start a timer; one of this name ends."""
        self.stop(name)
        self._timers[name] = self._node.create_timer(period_s, call, clock=clock)

    def stop(self, name: str) -> None:
        """End a timer, if there is one of this name."""
        timer = self._timers.pop(name, None)
        if timer is not None:
            self._node.destroy_timer(timer)

    def stop_all(self) -> None:
        """End all timers."""
        for name in list(self._timers):
            self.stop(name)
