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

"""All uses of internals of rclpy, in one place; the executor for samples is the largest.

Each docstring states the internals of Jazzy and Kilted that the code relies on;
``test_rclpy_internals.py`` checks them in the installed rclpy.
"""

import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NoReturn

import rclpy
from rclpy.client import Client
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from slip_detector.nodes.ending import SHUTDOWN_S

#: Most messages of a topic that the executor takes before other topics and timers have their turn.
MESSAGES_A_TURN = 32

#: Most messages of a topic that are taken at a poll: more than a queue of samples holds.
MESSAGES_A_POLL = 2000

#: Period in nanoseconds at which services, and the end of the process, are polled.
POLL_NS = 100_000_000

#: Python's switch interval, in seconds: the longest time for which a running thread keeps another
#: one waiting. The default is 5 ms.
SWITCH_S = 0.5e-3

#: The exceptions of the library below rclpy, raised for an invalid name or argument, for example.
ROS_ERRORS = rclpy_implementation.RCLError, rclpy_implementation.UnknownROSArgsError


class SampleExecutor(SingleThreadedExecutor):
    """Spins nodes that receive many messages and whose callbacks are plain functions.

    For each message rclpy's executor gathers all entities of the nodes (a managed node has a
    dozen services), makes a task, a coroutine and a wait set, and wakes itself twice, which costs
    several times as much as the message. Here the wait is for messages only, until the next timer
    is due, and the callbacks are called directly. Requests of services are looked for every
    ``POLL_NS``, events of the middleware (a subscriber with an incompatible quality of service)
    never.

    Relies on the ``WaitSet`` of ``rclpy_implementation``, which takes the numbers of
    subscriptions, guard conditions, timers, clients, services and events, and the context; on the
    ``handle`` of an entity, whose ``pointer`` identifies it in the list of ready ones; on
    ``call_timer`` of a timer's handle; on ``Subscription._callback_type``, which tells whether the
    callback also takes the middleware's information on a message; and on ``service_take_request``
    of a service's handle, which returns a request and its header, or None twice.
    """

    def __init__(self, context: rclpy.Context | None = None) -> None:
        super().__init__(context=context)
        sys.setswitchinterval(SWITCH_S)
        self._is_outdated = True
        self._due_ns = self._poll_ns = 0

    def wake(self) -> None:
        """Gather the entities again, because a node has created or destroyed one."""
        self._is_outdated = True
        super().wake()

    def spin_once(self, timeout_sec: float = math.inf) -> None:
        """Wait for messages and timers, at most for some time, and call their callbacks.

        Raises an ExternalShutdownException when the context was shut down.
        """
        if self._is_outdated:
            self._gather()
        wait_ns = min(max(0, self._due_ns - time.monotonic_ns()), timeout_sec * 1e9)
        if self._handles:
            self._wait_set.clear_entities()
            for handle in self._handles:
                self._wait_set.add_subscription(handle)
            self._wait_set.wait(int(wait_ns))
            for pointer in self._wait_set.get_ready_entities('subscription'):
                self._receive(self._subscriptions[pointer])
        else:  # rclpy refuses to wait for nothing.
            time.sleep(wait_ns * 1e-9)
        if time.monotonic_ns() >= self._due_ns:
            self._do_others()

    def _gather(self) -> None:
        """Collect all entities to wait for; which are due is found out after the next wait."""
        if not self.context.ok():
            raise ExternalShutdownException
        self._is_outdated = False  # Set first: a change during the gathering has to be seen, too.
        self._due_ns = 0
        nodes = self.get_nodes()
        subscriptions = [each for node in nodes for each in node.subscriptions]
        self._handles = [each.handle for each in subscriptions]
        self._subscriptions = {each.handle.pointer: each for each in subscriptions}
        self._timers = [timer for node in nodes for timer in node.timers]
        self._services = [service for node in nodes for service in node.services]
        n, context = len(subscriptions), self.context.handle
        self._wait_set = rclpy_implementation.WaitSet(n, 0, 0, 0, 0, 0, context)

    def _receive(self, subscription: Subscription) -> None:
        """Pass the messages of a subscription to its callback."""
        with_info = subscription._callback_type is subscription.CallbackType.WithMessageInfo
        for taken in take_messages(subscription, MESSAGES_A_TURN):
            subscription.callback(*taken if with_info else taken[:1])

    def _do_others(self) -> None:
        """Call timers and services that are due; find out when the next ones are."""
        if not self.context.ok():
            raise ExternalShutdownException
        for timer in self._timers:
            if timer.is_ready():
                timer.handle.call_timer()
                timer.callback()
                if self._is_outdated:  # The others may be gone.
                    return
        if time.monotonic_ns() >= self._poll_ns:
            for service in self._services:
                request, header = service.handle.service_take_request(service.srv_type.Request)
                if header is not None:
                    response = service.callback(request, service.srv_type.Response())
                    service.send_response(response, header)
                    return  # Another request may wait, and the entities may have changed.
            self._poll_ns = time.monotonic_ns() + POLL_NS
        now_ns = time.monotonic_ns()
        untils_ns = [timer.time_until_next_call() for timer in self._timers]
        self._due_ns = min([self._poll_ns, *(now_ns + ns for ns in untils_ns if ns is not None)])


def read_given_parameters(node: Node) -> list[Parameter]:
    """Return the parameters that the user gave to a node, declared or not.

    rclpy's own methods return only declared ones, so that an unknown name would go unnoticed.
    Relies on ``Node._parameter_overrides``, which ``Node.declare_parameter`` reads.
    """
    return list(node._parameter_overrides.values())


def answer_with(node: Node, service_type: type, callback: Callable[..., Any]) -> None:
    """Let a function answer requests that rclpy answers for each node, such as for parameters.

    Relies on the ``callback`` of services, which may be replaced.
    """
    for service in node.services:
        if service.srv_type is service_type:
            service.callback = callback


def survive_requests(node: Node) -> None:
    """Log the error of a request, or of a time on ``/clock``, and go on; rclpy ends the process.

    Examples are a transition that is impossible in the present state, a value of a type that does
    not exist, and a negative time. The response is the one made so far, which by default says that
    nothing was done. Relies on the ``callback`` of services and subscriptions, which may be
    replaced.
    """

    def surviving(callback: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            try:
                return callback(*arguments)
            except Exception as error:
                node.get_logger().warning(f'refused: {error}', throttle_duration_sec=1.0)
                return arguments[-1]

        return call

    clocks = [each for each in node.subscriptions if each.topic_name == '/clock']
    for entity in [*node.services, *clocks]:
        entity.callback = surviving(entity.callback)


def destroy_state_machine(node: LifecycleNode) -> None:
    """Destroy the state machine of a node, which a managed node that is destroyed leaves.

    Until then the state machine keeps the node in the middleware: other processes would see the
    node for some twenty seconds after the end of its process, as if that had been killed.

    Relies on ``LifecycleNodeMixin._state_machine``, whose ``destroy_when_not_in_use`` ends its
    use of the node.
    """
    node._state_machine.destroy_when_not_in_use()


def take_messages(subscription: Subscription, at_most: int) -> Iterator[tuple[Any, Any]]:
    """Yield the messages that a subscription has received, each with information on it.

    Relies on ``take_message`` of the handle, which returns both, or None.
    """
    for _ in range(at_most):
        taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        if taken is None:
            return
        yield taken


class PolledTopics:
    """The subscriptions of a node that is not spun, polled to take many messages at once.

    An executor that wakes up for each message costs several times as much as the message. The
    object is true while it has subscriptions.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._subscriptions: dict[str, Subscription] = {}

    def __bool__(self) -> bool:
        return bool(self._subscriptions)

    def add(
        self, message_type: Any, topic: str, qos: QoSProfile, name: str = '', raw: bool = False
    ) -> None:
        """Subscribe; the messages are taken by this name, by default that of the topic."""
        added = self._node.create_subscription(message_type, topic, lambda _: None, qos, raw=raw)
        self._subscriptions[name or topic] = added

    def take(self, name: str) -> list[tuple[Any, dict[str, Any]]]:
        """Return the messages that have come, each with its info; none without a subscription."""
        if name not in self._subscriptions:
            return []
        return [*take_messages(self._subscriptions[name], MESSAGES_A_POLL)]

    def close(self) -> None:
        """End all subscriptions."""
        for subscription in self._subscriptions.values():
            self._node.destroy_subscription(subscription)
        self._subscriptions = {}


def take_answers(clients: Iterable[Client]) -> None:
    """Complete the futures of requests that have been answered.

    With rclpy, an executor has to gather all entities of the node for that. Relies on
    ``take_response`` of the handle, which returns the header, with the ``request_id``, and the
    answer, or None twice; and on ``get_pending_request`` of the client, which returns the future.
    """
    for client in clients:
        with client.handle:
            header, answer = client.handle.take_response(client.srv_type.Response)
        if header is not None:
            client.get_pending_request(header.request_id.sequence_number).set_result(answer)


def shut_down_and_exit(take_down: Callable[[], object], code: int) -> NoReturn:
    """Take executor and nodes down, then the context, and end the process with an exit code.

    The middleware sometimes hangs during its shutdown, which must not keep the process alive. A
    timer ends the process; the alarm does so if the hang keeps Python's threads from running. The
    normal end of the interpreter takes up to a second, may hang in a library, and does nothing
    that the shutdown has not done already.
    """
    threading.Timer(SHUTDOWN_S, os._exit, (code,)).start()
    # Later than the timer, even if a busy machine wakes its thread a second late; sooner than
    # launch, which sends SIGTERM after 5 s.
    signal.setitimer(signal.ITIMER_REAL, 2 * SHUTDOWN_S)
    take_down()
    rclpy.try_shutdown()
    sys.stdout.flush()
    os._exit(code)
