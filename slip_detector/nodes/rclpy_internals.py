"""What the nodes use of rclpy that it does not promise to keep, all in one place.

Each function says what it relies on, as it is in Jazzy and Kilted. Where a distribution has
changed one of these, a :class:`RuntimeError` names it; ``test_rclpy_internals.py`` looks at each
in the rclpy that is installed.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

import rclpy
from lifecycle_msgs.srv import ChangeState
from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.subscription import Subscription
from rclpy.timer import Timer

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
    """

    def __init__(self, context: Context) -> None:
        self._make = _internal(rclpy_implementation, 'WaitSet')
        self._context = context
        self._made: Any = None
        self._sizes = (0, 0)

    def wait(
        self,
        subscriptions: Sequence[Subscription],
        guards: Sequence[GuardCondition],
        timeout_ns: int,
    ) -> tuple[list[Subscription], list[GuardCondition]]:
        """Return the subscriptions with messages and the triggered guards, at most a time later.

        What has triggered a guard is over with that: the wait takes it.
        """
        sizes = (len(subscriptions), len(guards))
        if self._made is None or sizes != self._sizes:
            self._made = self._make(*sizes, 0, 0, 0, 0, self._context.handle)
            self._sizes = sizes
        made = self._made
        made.clear_entities()
        for subscription in subscriptions:
            made.add_subscription(subscription.handle)
        for guard in guards:
            made.add_guard_condition(guard.handle)
        made.wait(timeout_ns)
        with_messages = made.get_ready_entities('subscription')
        triggered = made.get_ready_entities('guard_condition')
        return (
            [entity for entity in subscriptions if entity.handle.pointer in with_messages],
            [entity for entity in guards if entity.handle.pointer in triggered],
        )


def waking_guards(executor: Executor) -> list[GuardCondition]:
    """Return the guards that wake an executor: something is to be waited for, or a signal came.

    Relies on ``Executor._guard`` and ``Executor._sigint_gc``.
    """
    return [_internal(executor, '_guard'), _internal(executor, '_sigint_gc')]


def take_messages(subscription: Subscription, at_most: int) -> None:
    """Give the messages that have come to the callback of their subscription, at once.

    Relies on ``Subscription._callback_type``, which says whether the callback takes the
    middleware's information too, and on ``take_message`` of the handle: a message and its
    information, or None.
    """
    kind = _internal(subscription, '_callback_type')
    with_info = kind is subscription.CallbackType.WithMessageInfo
    take, message_type = subscription.handle.take_message, subscription.msg_type
    for _ in range(at_most):
        taken = take(message_type, subscription.raw)
        if taken is None:
            return
        subscription.callback(*(taken if with_info else taken[:1]))


def call(timer: Timer) -> None:
    """Give a timer that is due its next time, and call its callback.

    Relies on ``call_timer`` of the handle.
    """
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


def shut_down(nodes: Sequence[Node], code: int) -> None:
    """Take nodes and context down, or leave with the exit code where that takes too long.

    The middleware hangs now and then while it is taken down; that must not keep the process. The
    alarm is for a hang that lets no other thread of Python run.
    """
    bound = threading.Timer(SHUTDOWN_S, os._exit, (code,))
    bound.daemon = True
    bound.start()
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, 2 * SHUTDOWN_S)
    for node in nodes:
        node.destroy_node()
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
