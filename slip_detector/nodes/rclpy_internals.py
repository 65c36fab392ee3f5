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

"""All uses of internals of rclpy, in one place.

Each function states the internals of Jazzy and Kilted that it relies on. If a distribution has
changed one of them, a :class:`RuntimeError` names it; ``test_rclpy_internals.py`` checks all of
them in the installed rclpy.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack, suppress
from typing import Any, NoReturn, TypeVar

import rclpy
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import GetParameterTypes, SetParameters, SetParametersAtomically
from rclpy.client import Client
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle, ParameterNotDeclaredException
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from rclpy.timer import Timer

Entity = TypeVar('Entity', Subscription, Timer, GuardCondition)

#: Longest time, in seconds, for the shutdown of the middleware, which normally takes some
#: hundredths of a second. Other processes see a node that has ended without it for some twenty
#: seconds more.
SHUTDOWN_S = 2.0


def _internal(owner: Any, name: str) -> Any:
    """Return an internal attribute of rclpy.

    Raises
    ------
    RuntimeError
        When this version of rclpy does not have it.
    """
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


class WaitSet:
    """Waits for messages and guard conditions only.

    rclpy's executors gather all entities of all nodes at each wait. Relies on the ``WaitSet`` of
    ``rclpy.impl.implementation_singleton``, which takes the numbers of subscriptions, guard
    conditions, timers, clients, services and events, and the context; and on the ``handle`` of an
    entity, whose ``pointer`` identifies it in the list of ready ones.

    Parameters
    ----------
    subscriptions, guards
        Entities to wait for; they must not be destroyed during a wait, see :func:`held`.
    context
        The context of the entities.
    at_most
        Most messages of a subscription that are passed on at once.
    """

    def __init__(
        self,
        subscriptions: Sequence[Subscription],
        guards: Sequence[GuardCondition],
        context: Context,
        at_most: int,
    ) -> None:
        make = _internal(rclpy_implementation, 'WaitSet')
        self._made = make(len(subscriptions), len(guards), 0, 0, 0, 0, context.handle)
        self._subscriptions = [subscription.handle for subscription in subscriptions]
        self._guards = [guard.handle for guard in guards]
        self._receivers = {each.handle.pointer: receiver(each, at_most) for each in subscriptions}

    def wait(self, timeout_ns: int) -> list[Callable[[], None]]:
        """Wait, at most for the given time, and return functions that handle the messages.

        There is one for each subscription that has messages, see :func:`receiver`. A guard
        condition that is triggered ends one wait only.
        """
        made = self._made
        made.clear_entities()
        for subscription in self._subscriptions:
            made.add_subscription(subscription)
        for guard in self._guards:
            made.add_guard_condition(guard)
        made.wait(timeout_ns)
        return [self._receivers[pointer] for pointer in made.get_ready_entities('subscription')]


def held(entities: Iterable[Entity], until: ExitStack) -> list[Entity]:
    """Return the entities that still exist, and keep them from being destroyed.

    Another thread may destroy an entity at any time. Relies on its ``handle``, a context manager
    that keeps it while entered.

    Parameters
    ----------
    entities
        Subscriptions, timers or guard conditions.
    until
        Once this is closed, the entities may be destroyed.
    """
    kept = []
    for entity in entities:
        with suppress(InvalidHandle):
            until.enter_context(entity.handle)
            kept.append(entity)
    return kept


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


def subscriber_counter(publisher: Publisher) -> Callable[[], int]:
    """Return a function that counts the subscribers of a publisher, which must still exist.

    rclpy's own method keeps the publisher from being destroyed meanwhile, which costs more than
    the counting. Relies on ``get_subscription_count`` of the handle.
    """
    count: Callable[[], int] = publisher.handle.get_subscription_count
    return count


def publisher_counter(subscription: Subscription) -> Callable[[], int]:
    """Return a function that counts the publishers of a subscription, which must still exist.

    As :func:`subscriber_counter`; relies on ``get_publisher_count`` of the handle.
    """
    count: Callable[[], int] = subscription.handle.get_publisher_count
    return count


def until_due_ns(timer: Timer) -> int | None:
    """Return the time until a timer is due; None for a timer that was cancelled.

    Relies on ``time_until_next_call`` of the handle, which works for a :func:`held` timer even if
    another thread destroys it.
    """
    until_ns: int | None = timer.handle.time_until_next_call()
    return until_ns


def call_if_due(timer: Timer) -> None:
    """Call the callback of a timer if it is due, and begin its next period.

    Relies on ``is_timer_ready`` and ``call_timer`` of the handle, also of a :func:`held` timer.
    """
    if timer.handle.is_timer_ready():
        timer.handle.call_timer()
        timer.callback()


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
