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

"""The timers of a node, by name."""

from collections.abc import Callable

from rclpy.clock import Clock
from rclpy.node import Node
from rclpy.timer import Timer


class Timers:
    """Timers of a node; one can be restarted without disturbing the others.

    The object is true while it has timers.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._timers: dict[str, Timer] = {}

    def __bool__(self) -> bool:
        return bool(self._timers)

    def start(self, name: str, period_s: float, call: Callable[[], None], clock: Clock) -> None:
        """Start a timer; it replaces one of the same name."""
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
