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

"""An executor that takes samples directly from the middleware."""

import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack

from rclpy.clock import ClockType
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerGuardCondition
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from slip_detector.nodes.rclpy_internals import WaitSet, call_if_due, held, until_due_ns

#: Most messages of a topic that are taken before other topics and timers have their turn.
AT_MOST = 32

#: Calls that are put off wait until no message has come for this time, or until this many wait.
PAUSE_NS, MOST_PUT_OFF = 200_000, 64

#: Period, in seconds, at which both threads check whether they have to end. On a signal rclpy
#: first wakes all waits and then shuts the context down: a wait that begins in between goes on.
LONGEST_WAIT_S = 0.5

#: Python's switch interval, in seconds: the longest time for which a running thread keeps another
#: one waiting. The default is 5 ms.
SWITCH_S = 0.5e-3


class SampleExecutor(SingleThreadedExecutor):
    """Spins nodes that receive many messages and whose callbacks are plain functions.

    For each message rclpy's executor gathers all entities of the nodes (a managed node has a
    dozen services), makes a task, a coroutine and a wait set, and wakes itself twice, which costs
    several times as much as the message. Here the spinning thread waits only for messages, until
    the next timer is due, and calls the callbacks of messages and timers directly.

    In a second thread rclpy handles everything else: services, events, guard conditions. No
    message waits for these, however long they take. State that callbacks of both threads use needs
    a lock.

    Parameters
    ----------
    nodes
        At least one; all of the same context.
    """

    def __init__(self, nodes: Sequence[Node]) -> None:
        super().__init__(context=nodes[0].context)
        self._of_samples = nodes
        # Whether entities were created or destroyed since they were gathered. The guard condition
        # below ends a wait, also on a signal.
        self._changed = True
        self._guard_of_samples = SignalHandlerGuardCondition(self.context)
        self._held = ExitStack()
        self._timers: list[Timer] = []
        self._due_ns = 0
        self._due_may_move = False
        self._others: threading.Thread | None = None
        self._stop = False
        self._failure: Exception | None = None
        self._put_off: list[Callable[[], object]] = []
        for node in nodes:
            self.add_node(node)

    def can_execute(self, entity: object) -> bool:
        """Return whether the second thread handles an entity; rclpy asks for this."""
        return not isinstance(entity, Subscription | Timer) and bool(super().can_execute(entity))

    def wake(self) -> None:
        """Gather the entities again, because a node has created or destroyed one."""
        self._changed = True
        if not self._stop:
            self._guard_of_samples.trigger()
        super().wake()

    def put_off(self, call: Callable[[], object]) -> None:
        """Call a function once no message waits; may be used in callbacks of this executor."""
        self._put_off.append(call)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Wait for messages and timers, and call their callbacks.

        Parameters
        ----------
        timeout_sec
            Longest time to wait; the method may return earlier without calling a callback.

        Raises
        ------
        ExternalShutdownException
            When the context was shut down.
        Exception
            An exception of a callback, of either thread.
        """
        if self._others is None:
            sys.setswitchinterval(SWITCH_S)
            self._others = threading.Thread(target=self._do_others, daemon=True)
            self._others.start()
        if self._changed:
            self._gather()
        elif self._due_may_move:
            self._find_due()
        due_ns = self._due_ns - time.monotonic_ns()
        if timeout_sec is not None:
            due_ns = min(due_ns, round(timeout_sec * 1e9))
        put_off = self._put_off
        if put_off:
            due_ns = min(due_ns, PAUSE_NS)
        receivers = self._wait_set.wait(max(0, due_ns))
        for receive in receivers:
            receive()
        if put_off:
            if not receivers or len(put_off) >= MOST_PUT_OFF:
                self._put_off = []
                for call in put_off:
                    call()
            if time.monotonic_ns() < self._due_ns:
                return
        # Checking the context at each message would add a tenth to the cost.
        if not receivers or time.monotonic_ns() >= self._due_ns or self._due_may_move:
            if self._failure is not None:
                raise self._failure
            if not self.context.ok():
                raise ExternalShutdownException
            for timer in self._timers:
                call_if_due(timer)
            self._find_due()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """End the second thread, then shut rclpy's executor down.

        It must be called before the interpreter ends, which must not happen while a thread waits
        in the middleware.
        """
        self._stop = True
        if self._others is not None:
            self.create_task(lambda: None)  # Ends the wait of the second thread.
            self._others.join(timeout_sec)
        self._held.close()
        self._guard_of_samples.destroy()
        return bool(super().shutdown(timeout_sec))

    def _gather(self) -> None:
        """Collect all entities to wait for, and keep them from being destroyed during a wait."""
        self._changed = False  # Set first: a change during the gathering has to be seen, too.
        nodes = self._of_samples
        stack = ExitStack()
        subscriptions = held((each for node in nodes for each in node.subscriptions), stack)
        self._timers = held((each for node in nodes for each in node.timers), stack)
        guards = held([self._guard_of_samples], stack)
        self._wait_set = WaitSet(subscriptions, guards, self.context, AT_MOST)
        self._held.close()
        self._held = stack
        # A published clock may jump at any time.
        self._due_may_move = any(
            timer.clock.clock_type == ClockType.ROS_TIME for timer in self._timers
        )
        self._find_due()

    def _find_due(self) -> None:
        """Find out when, by :func:`time.monotonic_ns`, the next timer is due."""
        untils_ns = [until_due_ns(timer) for timer in self._timers]
        of_active_ns = [until_ns for until_ns in untils_ns if until_ns is not None]
        self._due_ns = time.monotonic_ns() + min([round(LONGEST_WAIT_S * 1e9), *of_active_ns])

    def _do_others(self) -> None:
        """Let rclpy handle everything that the spinning thread does not."""
        try:
            while not self._stop and self.context.ok():
                super().spin_once(LONGEST_WAIT_S)
        except ExternalShutdownException:
            pass
        except Exception as failure:
            if self.context.ok():
                self._failure = failure
                self._guard_of_samples.trigger()


def put_off(node: Node, call: Callable[[], object]) -> None:
    """Call a function once no message waits; at once if another executor spins the node."""
    executor = node.executor
    if isinstance(executor, SampleExecutor):
        executor.put_off(call)
    else:
        call()
