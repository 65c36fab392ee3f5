"""An executor that takes samples straight from the middleware."""

import itertools
import time
from collections.abc import Sequence

from rclpy.executors import (
    ExternalShutdownException,
    ShutdownException,
    SingleThreadedExecutor,
    TimeoutException,
)
from rclpy.node import Node

from slip_detector.nodes.rclpy_internals import WaitSet, call, take_messages, waking_guards

#: Messages taken in a row before timers and services are looked after.
AT_MOST = 32

#: Services are looked after this often while messages are waited for.
POLL_NS = 50_000_000


class SampleExecutor(SingleThreadedExecutor):
    """Spins nodes whose subscriptions are busy and whose callbacks are plain functions.

    For each message rclpy's executor gathers all entities of the nodes (a managed node has a
    dozen services), makes a task, a coroutine and a wait set, and wakes itself twice: several
    times the cost of the message. Here only the subscriptions are waited for, until the next
    timer is due, and a message or a timer goes straight to its callback. All else is left to
    rclpy, at least every ``POLL_NS``; and altogether, while there is no subscription.

    Parameters
    ----------
    nodes
        Of one context, at least one.
    """

    def __init__(self, nodes: Sequence[Node]) -> None:
        super().__init__(context=nodes[0].context)
        for node in nodes:
            self.add_node(node)
        self._of_samples = nodes
        # Looked after in turn: all at once would keep the samples waiting.
        self._next_nodes = itertools.cycle(nodes)
        self._poll_ns = POLL_NS // len(nodes)
        self._polled_ns = 0
        self._wait_set = WaitSet(self.context)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Wait for something to do, and do it.

        Parameters
        ----------
        timeout_sec
            Longest time to wait; it may be shorter, with nothing done.

        Raises
        ------
        ExternalShutdownException
            When the context was shut down meanwhile.
        """
        nodes = self._of_samples
        subscriptions = [subscription for node in nodes for subscription in node.subscriptions]
        if not subscriptions:
            super().spin_once(timeout_sec)
            return
        of_nodes = [guard for node in nodes for guard in node.guards]
        timers = [timer for node in nodes for timer in node.timers]
        due_ns = [timer.time_until_next_call() for timer in timers]
        if timeout_sec is not None:
            due_ns.append(round(timeout_sec * 1e9))
        with_messages, triggered = self._wait_set.wait(
            subscriptions,
            [*of_nodes, *waking_guards(self)],
            max(0, min([self._poll_ns, *due_ns])),
        )
        if not self.context.ok():
            raise ExternalShutdownException
        for guard in of_nodes:
            if guard in triggered:
                guard.trigger()  # For rclpy, which is to call its callback.
        for subscription in with_messages:
            take_messages(subscription, AT_MOST)
        if triggered:
            self._execute_others(nodes)
            return  # It may have changed subscriptions and timers.
        for timer in timers:
            if timer.is_ready():
                call(timer)
        if time.monotonic_ns() - self._polled_ns >= self._poll_ns:
            self._polled_ns = time.monotonic_ns()
            self._execute_others([next(self._next_nodes)])

    def _execute_others(self, nodes: Sequence[Node]) -> None:
        """Let rclpy do what is ready."""
        while True:
            try:
                handler, _, _ = self.wait_for_ready_callbacks(timeout_sec=0, nodes=nodes)
            except (TimeoutException, ShutdownException):
                return
            handler()
            if handler.exception() is not None:
                raise handler.exception()
