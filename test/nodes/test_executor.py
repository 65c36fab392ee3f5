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

"""The executor of the detector: messages first, and all else of rclpy in time."""

import threading

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

import rclpy
from rcl_interfaces.srv import GetParameters
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import Bool

from slip_detector.nodes.executor import AT_MOST, MOST_PUT_OFF, SampleExecutor, put_off
from slip_detector.nodes.messages import event_qos, state_qos

DEADLINE_S = 60.0

DEEP = state_qos(depth=1000)


@pytest.fixture
def spun(bench):
    """A node and the executor that spins it, in the context of the bench, in a thread."""
    node = Node('spun', context=bench.context)
    executor = SampleExecutor([node])
    stop = threading.Event()

    def spin():
        while not stop.is_set():
            executor.spin_once(timeout_sec=0.05)

    thread = threading.Thread(target=spin)
    node.start = thread.start
    yield node
    stop.set()
    thread.join(DEADLINE_S)
    executor.shutdown()
    node.destroy_node()


def spin(executor):
    while True:
        executor.spin_once(timeout_sec=1.0)


def subscribed(bench, node, taken):
    """Have a node take messages, and return a publisher that it knows."""
    subscription = node.create_subscription(Bool, 'said', taken, DEEP)
    publisher = bench.node.create_publisher(Bool, 'said', DEEP)
    bench.wait_for(
        lambda: publisher.get_subscription_count() and subscription.get_publisher_count(),
        'both to know each other',
    )
    return publisher


def test_what_is_put_off_is_done_when_no_message_waits_or_too_much_was_put_off(bench, spun):
    said = []

    def taken(message):
        said.append('message')
        put_off(spun, lambda: said.append('later'))

    publisher = subscribed(bench, spun, taken)
    # All of them wait when the executor begins.
    n = 2 * MOST_PUT_OFF
    for _ in range(n):
        publisher.publish(Bool())
    spun.start()
    bench.wait_for(lambda: said.count('later') == n, 'all that was put off')
    assert said.count('message') == n
    first = said.index('later')
    assert MOST_PUT_OFF <= first < n
    assert said[first : first + first] == ['later'] * first


def test_where_another_executor_spins_the_node_nothing_is_put_off(bench):
    said = []
    put_off(bench.node, lambda: said.append('now'))
    assert said == ['now']


def test_messages_come_in_their_order_with_and_without_information(bench, spun):
    taken, informed = [], []
    publisher = subscribed(bench, spun, lambda message: taken.append(message.data))
    spun.create_subscription(
        Bool, 'said', lambda message, info: informed.append(info['source_timestamp']), DEEP
    )
    bench.wait_for(lambda: publisher.get_subscription_count() == 2, 'the second subscription')
    said = [k % 3 == 0 for k in range(2 * AT_MOST + 1)]
    for one in said:
        publisher.publish(Bool(data=one))
    spun.start()
    bench.wait_for(lambda: len(taken) == len(informed) == len(said), 'all messages')
    assert taken == said
    assert informed == sorted(informed)


def test_timers_services_and_guards_are_served_while_nothing_comes(bench, spun):
    subscribed(bench, spun, lambda message: None)
    spun.declare_parameter('number', 7)
    ticks, woken = [], []
    spun.create_timer(
        0.01,
        lambda: ticks.append(threading.get_ident()),
        clock=Clock(clock_type=ClockType.STEADY_TIME),
    )
    guard = spun.create_guard_condition(lambda: woken.append(threading.get_ident()))
    spun.start()
    bench.wait_for(lambda: len(ticks) > 5, 'the timer')
    guard.trigger()
    bench.wait_for(lambda: woken, 'the guard')
    request = GetParameters.Request(names=['number'])
    (value,) = bench.ask(GetParameters, 'spun/get_parameters', request).values
    assert value.integer_value == 7
    # Timers with the messages, all else beside them.
    assert len(set(ticks)) == len(set(woken)) == len({*ticks, *woken}) / 2 == 1


def test_a_timer_is_not_kept_waiting_by_messages_without_end(bench, spun):
    taken, ticks = [], []
    publisher = subscribed(bench, spun, taken.append)
    spun.create_timer(0.01, lambda: ticks.append(len(taken)))
    spun.start()

    def flooded():
        for _ in range(4):
            publisher.publish(Bool())
        return len(ticks) > 10

    bench.wait_for(flooded, 'the timer')
    assert taken


def test_a_node_without_subscriptions_is_spun_as_rclpy_does(bench, spun):
    ticks = []
    spun.create_timer(0.01, lambda: ticks.append(None))
    spun.start()
    bench.wait_for(lambda: len(ticks) > 3, 'the timer')


def test_an_error_in_a_callback_is_raised_where_it_is_spun(bench):
    node = Node('spun', context=bench.context)
    executor = SampleExecutor([node])

    def fail(message):
        raise ZeroDivisionError('in a callback')

    publisher = subscribed(bench, node, fail)
    publisher.publish(Bool())
    with pytest.raises(ZeroDivisionError, match='in a callback'):
        spin(executor)
    executor.shutdown()
    node.destroy_node()


def test_the_end_of_the_context_ends_the_spinning():
    context = rclpy.Context()
    rclpy.init(context=context)
    node = Node('spun', context=context)
    node.create_subscription(Bool, 'said', lambda message: None, event_qos())
    executor = SampleExecutor([node])
    executor.spin_once(timeout_sec=0.0)
    timer = threading.Timer(0.1, lambda: rclpy.shutdown(context=context))
    timer.start()
    with pytest.raises(ExternalShutdownException):
        spin(executor)
    timer.join()
