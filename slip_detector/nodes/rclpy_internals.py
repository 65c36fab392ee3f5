"""What the nodes use of rclpy that it does not promise to keep, all in one place.

Each function says what it relies on, as it is in Jazzy and Kilted. Where a distribution has
changed one of these, a :class:`RuntimeError` names it; ``test_rclpy_internals.py`` looks at each
in the rclpy that is installed.
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
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from rclpy.timer import Timer

Entity = TypeVar('Entity', Subscription, Timer, GuardCondition)

#: Longest time for the middleware to be taken down; normally it takes some hundredths of a second.
SHUTDOWN_S = 0.4


def given_parameters(node: Node) -> dict[str, Parameter]:
    """Return the parameters that the user gave a node, by name, declared or not.

    rclpy offers them only one by one and for declared names: an unknown name would go unnoticed.
    Relies on ``Node._parameter_overrides``, which ``Node.declare_parameter`` reads.
    """
    return dict(_internal(node, '_parameter_overrides'))


def answer_impossible_transitions(node: LifecycleNode) -> None:
    """Have a request for a transition that the present state does not allow answered with no.

    rclpy lets its error end the process. Relies on ``LifecycleNode._service_change_state``, the
    service, whose ``callback`` may be replaced.
    """
    service = _internal(node, '_service_change_state')
    change_state = _internal(service, 'callback')
    error_class = _internal(rclpy_implementation, 'RCLError')

    def answer(request: ChangeState.Request, response: ChangeState.Response) -> Any:
        try:
            return change_state(request, response)
        except error_class as error:
            node.get_logger().warning(f'refused: {" ".join(str(error).split())}')
            response.success = False
            return response

    service.callback = answer


class WaitSet:
    """Waits for the messages and guard conditions of a context, and for nothing else.

    rclpy's executors gather all entities of all nodes each time. Relies on the ``WaitSet`` of
    ``rclpy.impl.implementation_singleton``, made for so many subscriptions, guard conditions,
    timers, clients, services and events of a context, and on the ``handle`` of an entity, whose
    ``pointer`` is in the list of those that are ready.

    Parameters
    ----------
    subscriptions, guards
        None of them may be taken down while they are waited for: see :func:`held`.
    context
        Theirs.
    """

    def __init__(
        self,
        subscriptions: Sequence[Subscription],
        guards: Sequence[GuardCondition],
        context: Context,
    ) -> None:
        make = _internal(rclpy_implementation, 'WaitSet')
        self._made = make(len(subscriptions), len(guards), 0, 0, 0, 0, context.handle)
        self._subscriptions = [subscription.handle for subscription in subscriptions]
        self._guards = [guard.handle for guard in guards]

    def wait(self, timeout_ns: int) -> list[int]:
        """Return the pointers of the subscriptions with messages, at most a time later.

        What has triggered a guard is over with that: the wait takes it.
        """
        made = self._made
        made.clear_entities()
        for subscription in self._subscriptions:
            made.add_subscription(subscription)
        for guard in self._guards:
            made.add_guard_condition(guard)
        made.wait(timeout_ns)
        with_messages: list[int] = made.get_ready_entities('subscription')
        return with_messages


def held(entities: Iterable[Entity], until: ExitStack) -> list[Entity]:
    """Return the entities that are not taken down yet, and put that off for them.

    Another thread may take an entity down at any time. Relies on its ``handle``, which stays while
    it is entered as a context.

    Parameters
    ----------
    entities
        Subscriptions, timers or guard conditions.
    until
        When it is closed, they may be taken down.
    """
    kept = []
    for entity in entities:
        with suppress(InvalidHandle):
            until.enter_context(entity.handle)
            kept.append(entity)
    return kept


def receiver(subscription: Subscription, at_most: int) -> Callable[[], None]:
    """Return what gives the messages that have come to the callback of their subscription.

    Relies on ``Subscription._callback_type``, which says whether the callback takes the
    middleware's information too, and on ``take_message`` of the handle: a message and its
    information, or None.
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


def subscriber_counter(publisher: Publisher) -> Callable[[], int]:
    """Return what counts the subscribers of a publisher, which must not be taken down before.

    rclpy's own method keeps the publisher from being taken down meanwhile, which costs more than
    to count. Relies on ``get_subscription_count`` of the handle.
    """
    count: Callable[[], int] = publisher.handle.get_subscription_count
    return count


def until_due_ns(timer: Timer) -> int | None:
    """Return the time until a timer is due; None where it is never.

    Relies on ``time_until_next_call`` of the handle, which answers for a timer that is
    :func:`held` while another thread takes it down.
    """
    until_ns: int | None = timer.handle.time_until_next_call()
    return until_ns


def call_if_due(timer: Timer) -> None:
    """Give a timer that is due its next time, and call its callback.

    Relies on ``is_timer_ready`` and ``call_timer`` of the handle, also for a timer that is
    :func:`held`.
    """
    if timer.handle.is_timer_ready():
        timer.handle.call_timer()
        timer.callback()


def ignore_what_a_signal_leaves(initialised: Callable[[], bool]) -> None:
    """Keep quiet about objects of rclpy that a signal has left unfinished.

    A signal takes the context away in the midst of a call; Python then tells of exceptions in
    destructors, which mean nothing to a user.

    Parameters
    ----------
    initialised
        Whether rclpy has been.
    """

    def on_unraisable(problem: Any) -> None:
        if not initialised() or rclpy.ok():
            sys.__unraisablehook__(problem)

    sys.unraisablehook = on_unraisable


def shut_down(takedowns: Sequence[Callable[[], object]], code: int) -> None:
    """Take everything down, the context last, or leave with the exit code where that takes long.

    The middleware hangs now and then while it is taken down; that must not keep the process. The
    alarm is for a hang that lets no other thread of Python run.

    Parameters
    ----------
    takedowns
        Of executor and nodes, in their order.
    code
        Exit code of a process that is left before all is down.
    """
    bound = threading.Timer(SHUTDOWN_S, os._exit, (code,))
    bound.daemon = True
    bound.start()
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, 2 * SHUTDOWN_S)
    for takedown in takedowns:
        takedown()
    rclpy.try_shutdown()


def leave(code: int) -> NoReturn:
    """End the process at once.

    What would come after, the taking down of the interpreter and the libraries, takes up to a
    second, may hang, and does nothing that the shutdown of rclpy has not done.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _internal(owner: Any, name: str) -> Any:
    """Return an attribute that rclpy does not promise.

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
