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

"""What is relied on in rclpy, in the version that is installed."""

import signal
import subprocess
import sys
import time
from contextlib import ExitStack

import pytest

rclpy = pytest.importorskip('rclpy', reason='needs rclpy')

from builtin_interfaces.msg import Time  # noqa: E402
from lifecycle_msgs.msg import State, Transition  # noqa: E402
from lifecycle_msgs.srv import ChangeState  # noqa: E402
from rcl_interfaces.srv import GetParameters  # noqa: E402
from rclpy.clock import Clock, ClockType  # noqa: E402
from rclpy.exceptions import InvalidHandle  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.lifecycle import LifecycleNode  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rosgraph_msgs.msg import Clock as ClockMessage  # noqa: E402
from std_msgs.msg import Bool  # noqa: E402

from slip_detector.nodes.messages import event_qos  # noqa: E402
from slip_detector.nodes.rclpy_internals import (  # noqa: E402
    WaitSet,
    answer_impossible_transitions,
    call_if_due,
    destroy_state_machine,
    given_parameters,
    held,
    ignore_impossible_times,
    publisher_counter,
    receiver,
    send_request,
    subscriber_counter,
    take_answer,
    until_due_ns,
)

DEADLINE_NS = 60 * 10**9
WAIT_NS = 10**7


@pytest.fixture
def context():
    context = rclpy.Context()
    rclpy.init(context=context)
    yield context
    rclpy.try_shutdown(context=context)


@pytest.fixture
def node(context):
    words = ['--ros-args', '-p', 'declared:=1', '-p', 'unknown:=2']
    node = Node('of_test', context=context, cli_args=words)
    yield node
    node.destroy_node()


def test_parameters_are_given_by_name_before_any_is_declared(node):
    given = {name: parameter.value for name, parameter in given_parameters(node).items()}
    assert given == {'declared': 1, 'unknown': 2}


def test_a_transition_that_is_not_possible_is_answered_with_no_and_one_that_is_is_made(context):
    node = LifecycleNode('of_test', context=context)
    answer_impossible_transitions(node)
    callback = node._service_change_state.callback

    def change(transition):
        request = ChangeState.Request(transition=Transition(id=transition))
        return callback(request, ChangeState.Response()).success

    assert not change(Transition.TRANSITION_ACTIVATE)
    assert change(Transition.TRANSITION_CONFIGURE)
    assert node._state_machine.current_state[0] == State.PRIMARY_STATE_INACTIVE
    node.destroy_node()
    destroy_state_machine(node)
    with pytest.raises(InvalidHandle), node._state_machine:
        pass


@pytest.mark.parametrize('from_the_start', [True, False])
def test_a_negative_time_does_not_reach_the_clock_and_others_do(context, from_the_start):
    words = ['--ros-args', '-p', 'use_sim_time:=true'] if from_the_start else None
    node = Node('of_test', context=context, cli_args=words)
    ignore_impossible_times(node)
    if not from_the_start:
        node.set_parameters([Parameter('use_sim_time', value=True)])
    (subscription,) = node.subscriptions
    for sec in (7, -1):
        subscription.callback(ClockMessage(clock=Time(sec=sec)))
        assert node.get_clock().now().nanoseconds == 7 * 10**9
    node.destroy_node()


@pytest.mark.parametrize('with_info', [False, True])
def test_messages_are_waited_for_and_go_to_the_callback(context, node, with_info):
    taken = []
    if with_info:
        subscription = node.create_subscription(
            Bool, 'said', lambda message, info: taken.append((message.data, info)), event_qos()
        )
    else:
        subscription = node.create_subscription(
            Bool, 'said', lambda message: taken.append((message.data, None)), event_qos()
        )
    publisher = node.create_publisher(Bool, 'said', event_qos())
    wait_set = WaitSet([subscription], [], context, at_most=2)
    assert wait_set.wait(0) == []
    while not subscription.get_publisher_count() or not publisher.get_subscription_count():
        wait_set.wait(10**7)
    for said in (True, False, True):
        publisher.publish(Bool(data=said))
    while len(taken) < 3:
        (receive,) = wait_set.wait(DEADLINE_NS)
        before = len(taken)
        receive()
        assert len(taken) <= before + 2
    assert [said for said, _ in taken] == [True, False, True]
    if with_info:
        stamps_ns = [info['source_timestamp'] for _, info in taken]
        assert stamps_ns == sorted(stamps_ns)
        assert stamps_ns[0] > 0
        # Fast DDS numbers what a publisher sends.
        first = taken[0][1]['publication_sequence_number']
        assert [info['publication_sequence_number'] - first for _, info in taken] == [0, 1, 2]


def test_a_service_is_asked_and_answers_without_an_executor_of_the_client(context, node):
    executor = SingleThreadedExecutor(context=context)
    server = Node('of_answers', context=context)
    server.declare_parameter('gain', 2)
    executor.add_node(server)
    client = node.create_client(GetParameters, 'of_answers/get_parameters')
    assert take_answer(client) is None
    asked, answered = [], None
    while answered is None:
        # An answer may be lost before the service knows the client.
        if client.service_is_ready():
            asked.append(send_request(client, GetParameters.Request(names=['gain'])))
        executor.spin_once(0.1)
        answered = take_answer(client)
    assert answered[0] in asked
    assert answered[1].values[0].integer_value == 2
    executor.shutdown()
    server.destroy_node()


def test_subscribers_are_counted_as_rclpy_counts_them(node):
    publisher = node.create_publisher(Bool, 'said', event_qos())
    count = subscriber_counter(publisher)
    assert count() == 0
    node.create_subscription(Bool, 'said', lambda message: None, event_qos())
    while not count():
        pass
    assert count() == publisher.get_subscription_count() == 1


def test_the_publishers_of_a_subscription_are_counted_as_rclpy_counts_them(node):
    subscription = node.create_subscription(Bool, 'said', lambda message: None, event_qos())
    count = publisher_counter(subscription)
    assert count() == 0
    for _ in range(2):
        node.create_publisher(Bool, 'said', event_qos())
    while count() < 2:
        pass
    assert count() == subscription.get_publisher_count()


def test_a_guard_ends_the_wait_and_the_wait_takes_what_triggered_it(context, node):
    guard, other = (node.create_guard_condition(lambda: None) for _ in range(2))
    wait_set = WaitSet([], [guard, other], context, at_most=1)
    began_s = time.monotonic()
    guard.trigger()
    assert wait_set.wait(DEADLINE_NS) == []
    assert time.monotonic() - began_s < DEADLINE_NS * 1e-9
    # Else this would end at once.
    began_s = time.monotonic()
    wait_set.wait(WAIT_NS)
    assert time.monotonic() - began_s > 0.5e-9 * WAIT_NS


def test_what_is_held_is_taken_down_when_it_is_no_longer_held(node):
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    timers = [node.create_timer(3600.0, lambda: None, clock=steady) for _ in range(3)]
    first, second, third = timers
    node.destroy_timer(first)
    with ExitStack() as stack:
        assert held(timers, stack) == [second, third]
        node.destroy_timer(second)
        assert until_due_ns(second) > 0
        call_if_due(second)
        with ExitStack() as late:
            # Who comes now does not get it any more.
            assert held(timers, late) == [third]
        assert until_due_ns(second) > 0
    with pytest.raises(RuntimeError):
        until_due_ns(second)
    assert until_due_ns(third) > 0


def test_a_timer_is_called_when_it_is_due_and_is_due_again_a_period_later(node):
    called = []
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    timer = node.create_timer(0.01, lambda: called.append(None), clock=steady)
    early = node.create_timer(3600.0, lambda: called.append(None), clock=steady)
    while until_due_ns(timer) > 0:
        call_if_due(early)
    assert not called
    call_if_due(timer)
    assert len(called) == 1
    assert 0 < until_due_ns(early) <= 3600 * 10**9
    timer.timer_period_ns = 3600 * 10**9
    timer.reset()
    call_if_due(timer)
    assert len(called) == 1
    timer.cancel()
    assert until_due_ns(timer) is None


@pytest.mark.parametrize(
    ('name', 'use'),
    [
        ('_parameter_overrides', given_parameters),
        ('_service_change_state', answer_impossible_transitions),
        ('_callback_type', lambda subscription: receiver(subscription, 1)),
    ],
)
def test_what_a_version_of_rclpy_has_changed_is_named(name, use):
    class Changed:
        pass

    with pytest.raises(RuntimeError, match=rf'^Changed\.{name} is not there: .*this version'):
        use(Changed())


HANGING = """
import time
from slip_detector.nodes.rclpy_internals import shut_down

def hanging():
    {hang}

shut_down([hanging], 7)
print('all is down')
"""

#: A call that waits with Python's lock held, so that no other thread runs.
LOCKED = 'import ctypes; ctypes.PyDLL(None).sleep(3600)'

LEAVING = """
import atexit
from slip_detector.nodes.rclpy_internals import leave

atexit.register(print, 'and more')
print('printed', end='')
leave(3)
"""


def run(code):
    return subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=False, timeout=60
    )


@pytest.mark.parametrize(
    ('hang', 'code'),
    [('time.sleep(3600)', 7), (LOCKED, -signal.SIGALRM), ('pass', 0)],
)
def test_a_middleware_that_hangs_does_not_keep_the_process(hang, code):
    done = run(HANGING.format(hang=hang))
    assert done.returncode == code, done.stderr
    assert done.stdout == ('' if code else 'all is down\n')


def test_leaving_writes_what_was_printed_and_runs_nothing_else():
    done = run(LEAVING)
    assert (done.returncode, done.stdout) == (3, 'printed')
