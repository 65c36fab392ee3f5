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

Each states the internals of Jazzy and Kilted that it relies on. If a distribution has changed one
of them, a :class:`RuntimeError` names it; ``test_rclpy_internals.py`` checks all of them in the
installed rclpy.
"""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, NoReturn

import rclpy
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import GetParameterTypes, SetParameters, SetParametersAtomically
from rclpy.client import Client
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.service import Service
from rclpy.subscription import Subscription

#: Longest time, in seconds, for the shutdown of the middleware, which normally takes some
#: hundredths of a second. Other processes see a node that has ended without it for some twenty
#: seconds more.
SHUTDOWN_S = 2.0

#: Most messages of a topic that are taken before other topics and timers have their turn.
AT_MOST = 32

#: Calls that are put off wait until no message has come for this time, or until this many wait.
PAUSE_NS, MOST_PUT_OFF = 200_000, 64

#: Period at which requests of services, and the end of the process, are looked for.
LOOK_NS = 50_000_000

#: Python's switch interval, in seconds: the longest time for which a running thread keeps another
#: one waiting. The default is 5 ms.
SWITCH_S = 0.5e-3


def _internal(owner: Any, name: str) -> Any:
    """Return an internal attribute of rclpy; a RuntimeError if this version does not have it."""
    try:
        return getattr(owner, name)
    except AttributeError:
        what = getattr(owner, '__name__', type(owner).__name__)
        raise RuntimeError(
            f'{what}.{name} is not there: slip_detector.nodes.rclpy_internals relies on it, and '
            'this version of rclpy has changed it'
        ) from None


#: The exception of the library below rclpy, raised for an invalid name, for example.
ROS_ERROR: type[Exception] = _internal(rclpy_implementation, 'RCLError')


class SampleExecutor(SingleThreadedExecutor):
    """Spins nodes that receive many messages and whose callbacks are plain functions.

    For each message rclpy's executor gathers all entities of the nodes (a managed node has a
    dozen services), makes a task, a coroutine and a wait set, and wakes itself twice, which costs
    several times as much as the message. Here the wait is for messages only, until the next timer
    is due, and the callbacks of messages and timers are called directly. Requests of services are
    looked for every ``LOOK_NS``, and served by rclpy.

    Relies on the ``WaitSet`` of ``rclpy_implementation``, which takes the numbers of
    subscriptions, guard conditions, timers, clients, services and events, and the context; on the
    ``handle`` of an entity, whose ``pointer`` identifies it in the list of ready ones; and on
    ``call_timer`` of a timer's handle.

    Parameters
    ----------
    nodes
        At least one; all of the same context.
    """

    def __init__(self, nodes: Sequence[Node]) -> None:
        super().__init__(context=nodes[0].context)
        sys.setswitchinterval(SWITCH_S)
        self._changed = True
        self._due_ns = self._look_ns = 0
        self._put_off: list[Callable[[], object]] = []
        for node in nodes:
            self.add_node(node)

    def can_execute(self, entity: object) -> bool:
        """Return whether rclpy may serve an entity; it asks for this."""
        return isinstance(entity, Service) and bool(super().can_execute(entity))

    def wake(self) -> None:
        """Gather the entities again, because a node has created or destroyed one."""
        self._changed = True
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
        """
        if self._changed:
            self._gather()
        wait_ns = self._due_ns - time.monotonic_ns()
        if timeout_sec is not None:
            wait_ns = min(wait_ns, round(timeout_sec * 1e9))
        if self._put_off:
            wait_ns = min(wait_ns, PAUSE_NS)
        ready = self._ready(self._samples, 'subscription', max(0, wait_ns))
        for pointer in ready:
            self._receivers[pointer]()
        if self._put_off and (not ready or len(self._put_off) >= MOST_PUT_OFF):
            calls, self._put_off = self._put_off, []
            for call in calls:
                call()
        if time.monotonic_ns() >= self._due_ns:
            self._do_others()

    def _gather(self) -> None:
        """Collect all entities to wait for; what is due is found out after the next wait."""
        if not self.context.ok():
            raise ExternalShutdownException
        self._changed = False  # Set first: a change during the gathering has to be seen, too.
        self._due_ns = 0
        nodes = self.get_nodes()
        subscriptions = [each for node in nodes for each in node.subscriptions]
        self._receivers = {each.handle.pointer: receiver(each, AT_MOST) for each in subscriptions}
        self._timers = [timer for node in nodes for timer in node.timers]
        services = [service.handle for node in nodes for service in node.services]
        make, context = _internal(rclpy_implementation, 'WaitSet'), self.context.handle
        made = make(len(subscriptions), 0, 0, 0, 0, 0, context)
        self._samples = made, made.add_subscription, [each.handle for each in subscriptions]
        made = make(0, 0, 0, 0, len(services), 0, context)
        self._requests = made, made.add_service, services

    @staticmethod
    def _ready(waiting: tuple[Any, Any, list[Any]], kind: str, timeout_ns: int) -> list[int]:
        """Wait, at most for the given time; return the pointers of entities that are ready."""
        wait_set, add, handles = waiting
        if not handles:  # rclpy refuses to wait for nothing.
            time.sleep(timeout_ns * 1e-9)
            return []
        wait_set.clear_entities()
        for handle in handles:
            add(handle)
        wait_set.wait(timeout_ns)
        ready: list[int] = wait_set.get_ready_entities(kind)
        return ready

    def _do_others(self) -> None:
        """Call timers and services that are due; find out when the next ones are."""
        if not self.context.ok():
            raise ExternalShutdownException
        for timer in self._timers:
            if timer.is_ready():
                timer.handle.call_timer()
                timer.callback()
                if self._changed:  # The others may be gone.
                    return
        if time.monotonic_ns() >= self._look_ns:
            while not self._changed and self._ready(self._requests, 'service', 0):
                super().spin_once(0.0)
            if self._changed:
                return
            self._look_ns = time.monotonic_ns() + LOOK_NS
        untils_ns = [timer.time_until_next_call() for timer in self._timers]
        now_ns = time.monotonic_ns()
        of_active_ns = [now_ns + until_ns for until_ns in untils_ns if until_ns is not None]
        self._due_ns = min([self._look_ns, *of_active_ns])


def given_parameters(node: Node) -> dict[str, Parameter]:
    """Return the parameters that the user gave to a node, by name, declared or not.

    rclpy's own methods return only declared ones, so that an unknown name would go unnoticed.
    Relies on ``Node._parameter_overrides``, which ``Node.declare_parameter`` reads.
    """
    return dict(_internal(node, '_parameter_overrides'))


def answer_impossible_transitions(node: LifecycleNode) -> None:
    """Refuse requests for a transition that is impossible in the present state.

    In rclpy the error ends the process. Relies on ``LifecycleNode._service_change_state``, the
    service, whose ``callback`` may be replaced.
    """
    service = _internal(node, '_service_change_state')
    change_state = _internal(service, 'callback')

    def answer(request: ChangeState.Request, response: ChangeState.Response) -> Any:
        try:
            return change_state(request, response)
        except ROS_ERROR as error:
            node.get_logger().warning(f'refused: {" ".join(str(error).split())}')
            response.success = False
            return response

    service.callback = answer


def destroy_state_machine(node: LifecycleNode) -> None:
    """Destroy the state machine of a node that is destroyed, which does not do so.

    Until then it keeps the node in the middleware: others would see the node for some twenty
    seconds after its process has ended, as if that had been killed.

    Relies on ``LifecycleNodeMixin._state_machine``, whose ``destroy_when_not_in_use`` ends its
    use of the node.
    """
    _internal(_internal(node, '_state_machine'), 'destroy_when_not_in_use')()


def mend_parameter_services(node: Node) -> None:
    """Answer two requests about parameters whose errors in rclpy end the process.

    One sets a value of a type that does not exist, and is refused. The other asks for the type of
    a parameter that is not declared, which the detector allows. Relies on ``Service.srv_type``,
    and on ``Service.callback``, which may be replaced.
    """

    def types(
        request: GetParameterTypes.Request, response: GetParameterTypes.Response
    ) -> GetParameterTypes.Response:
        # For an undeclared parameter rclpy returns a member of the enumeration, not its number.
        with suppress(ParameterNotDeclaredException):
            found = [Parameter.Type(node.get_parameter_type(name)) for name in request.names]
            response.types = [each.value for each in found]
        return response

    for service in node.services:
        kind = _internal(service, 'srv_type')
        if kind is GetParameterTypes:
            service.callback = types
        elif kind in (SetParameters, SetParametersAtomically):
            service.callback = _refusing_types(_internal(service, 'callback'))


def _refusing_types(take: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Return a callback that sets parameters, but refuses all if the type of one is unknown."""

    def answer(request: Any, response: Any) -> Any:
        try:
            for each in request.parameters:
                Parameter.Type(each.value.type)
        except ValueError as error:
            refused = SetParametersResult(successful=False, reason=str(error))
            if isinstance(response, SetParametersAtomically.Response):
                response.result = refused
            else:
                response.results = [refused] * len(request.parameters)
            return response
        return take(request, response)

    return answer


def ignore_impossible_times(node: Node) -> None:
    """Ignore negative times on ``/clock``, which no ROS clock can have.

    In rclpy the error ends the process. Relies on ``Node._time_source``, whose ``clock_callback``
    may be replaced, and on its ``_clock_sub``, the subscription or None, whose ``callback`` may be
    replaced.
    """
    source = _internal(node, '_time_source')
    take = _internal(source, 'clock_callback')

    def take_if_possible(message: Any) -> None:
        try:
            take(message)
        except ValueError as error:
            node.get_logger().warning(
                f'/clock is {message.clock.sec} s and {message.clock.nanosec} ns, allowed: no '
                f'negative time ({error}); ignored',
                throttle_duration_sec=1.0,
            )

    source.clock_callback = take_if_possible  # For a later subscription, made by use_sim_time.
    subscription = _internal(source, '_clock_sub')
    if subscription is not None:
        subscription.callback = take_if_possible


def receiver(subscription: Subscription, at_most: int) -> Callable[[], None]:
    """Return a function that passes the messages of a subscription to its callback.

    Relies on ``Subscription._callback_type``, which tells whether the callback also takes the
    middleware's information on the message, and on ``take_message`` of the handle, which returns a
    message and this information, or None.
    """
    kind = _internal(subscription, '_callback_type')
    with_info = kind is subscription.CallbackType.WithMessageInfo
    take, message_type = subscription.handle.take_message, subscription.msg_type
    raw, callback = subscription.raw, subscription.callback

    def receive() -> None:
        for _ in range(at_most):
            taken = take(message_type, raw)
            if taken is None:
                return
            callback(*taken if with_info else taken[:1])

    return receive


def send_request(client: Client, request: Any) -> int:
    """Send a request to a service without waiting; return the number of the request.

    Relies on ``send_request`` of the handle.
    """
    with client.handle:
        number: int = client.handle.send_request(request)
    return number


def take_answer(client: Client) -> tuple[int, Any] | None:
    """Return the number of an answered request and its answer; None if there is none.

    With rclpy, an executor has to gather all entities of the node for that. Relies on
    ``take_response`` of the handle, which returns the header, with the ``request_id``, and the
    answer, or None twice.
    """
    with client.handle:
        header, answer = client.handle.take_response(client.srv_type.Response)
    return None if header is None else (header.request_id.sequence_number, answer)


def ignore_what_a_signal_leaves(initialised: Callable[[], bool]) -> None:
    """Do not print exceptions in destructors of rclpy's objects after a signal.

    A signal shuts the context down in the middle of a call. Python then prints exceptions in
    destructors, which mean nothing to a user.

    Parameters
    ----------
    initialised
        Returns whether rclpy has been initialised.
    """

    def on_unraisable(problem: Any) -> None:
        if not initialised() or rclpy.ok():
            sys.__unraisablehook__(problem)

    sys.unraisablehook = on_unraisable


def shut_down(takedowns: Sequence[Callable[[], object]], code: int) -> None:
    """Shut everything down, the context last; if this takes too long, end with the exit code.

    The middleware sometimes hangs during its shutdown, which must not keep the process alive. A
    timer ends the process; the alarm does so if the hang keeps Python's threads from running.

    Parameters
    ----------
    takedowns
        Functions that shut down the executor and the nodes, in this order.
    code
        Exit code if the process has to end before the shutdown is complete.
    """
    bound = threading.Timer(SHUTDOWN_S, os._exit, (code,))
    bound.daemon = True
    bound.start()
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    # Later than the timer, even if a busy machine wakes its thread a second late; sooner than
    # launch, which sends SIGTERM after 5 s.
    signal.setitimer(signal.ITIMER_REAL, 2 * SHUTDOWN_S)
    for takedown in takedowns:
        takedown()
    rclpy.try_shutdown()


def leave(code: int) -> NoReturn:
    """End the process at once.

    The normal end of the interpreter takes up to a second, may hang in a library, and does nothing
    that the shutdown of rclpy has not done already.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
