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

import pytest
import rclpy
from builtin_interfaces.msg import Time
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import GetParameters
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidHandle
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.task import Future
from rosgraph_msgs.msg import Clock as ClockMessage
from std_msgs.msg import Bool

from slip_detector.nodes.messages import event_qos
from slip_detector.nodes.rclpy_internals import (
    MESSAGES_A_TURN,
    SampleExecutor,
    destroy_state_machine,
    survive_requests,
    take_answers,
)
from support.python_runs import run_python


def test_what_cannot_be_done_is_answered_with_no_and_the_node_goes_on(bench):
    node = LifecycleNode('of_test', context=bench.context)
    survive_requests(node)
    (service,) = (each for each in node.services if each.srv_type is ChangeState)

    def change(transition):
        request = ChangeState.Request(transition=Transition(id=transition))
        return service.callback(request, ChangeState.Response()).success

    assert not change(Transition.TRANSITION_ACTIVATE)
    assert change(Transition.TRANSITION_CONFIGURE)
    assert node._state_machine.current_state[0] == State.PRIMARY_STATE_INACTIVE
    node.destroy_node()
    destroy_state_machine(node)
    with pytest.raises(InvalidHandle), node._state_machine:
        pass


def test_a_negative_time_does_not_reach_the_clock_and_others_do(bench):
    words = ['--ros-args', '-p', 'use_sim_time:=true']
    node = Node('of_test', context=bench.context, cli_args=words)
    survive_requests(node)
    (subscription,) = node.subscriptions
    for sec in (7, -1):
        subscription.callback(ClockMessage(clock=Time(sec=sec)))
        assert node.get_clock().now().nanoseconds == 7 * 10**9
    node.destroy_node()


def test_messages_timers_and_services_are_served(bench):
    node = Node('of_test', context=bench.context)
    calls, client = [], node.create_client(GetParameters, 'of_answers/get_parameters')
    served = Node('of_answers', context=bench.context)
    served.declare_parameter('gain', 2)
    executor = SampleExecutor(bench.context)
    executor.add_node(served)

    def on_said(message, info):
        calls.append(('said', info['publication_sequence_number']))

    served.create_subscription(Bool, 'said', on_said, event_qos())
    publisher = node.create_publisher(Bool, 'said', event_qos())
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    timer = served.create_timer(0.01, lambda: calls.append(('timer', None)), clock=steady)
    while not publisher.get_subscription_count() or not client.service_is_ready():
        executor.spin_once(0.01)
    for _ in range(3):
        publisher.publish(Bool())
    while len([kind for kind, _ in calls if kind == 'said']) < 3 or ('timer', None) not in calls:
        executor.spin_once(0.01)
    told = [number for kind, number in calls if kind == 'said']
    # Fast DDS numbers what a publisher sends.
    assert [number - told[0] for number in told] == [0, 1, 2]
    served.destroy_timer(timer)
    asked = []
    while not (done := [*filter(Future.done, asked)]):
        # An answer may be lost before the service knows the client.
        asked.append(client.call_async(GetParameters.Request(names=['gain'])))
        executor.spin_once(0.1)
        take_answers([client])
    assert done[0].result().values[0].integer_value == 2
    rclpy.try_shutdown(context=bench.context)
    with pytest.raises(ExternalShutdownException):
        executor._do_others()
    executor.shutdown()
    for each in (node, served):
        each.destroy_node()


def test_a_topic_of_many_messages_lets_others_have_their_turn(bench):
    node, heard = Node('of_test', context=bench.context), []
    executor = SampleExecutor(bench.context)
    executor.add_node(node)
    node.create_subscription(Bool, 'said', heard.append, event_qos(100))
    publisher = node.create_publisher(Bool, 'said', event_qos(100))
    while not publisher.get_subscription_count():
        executor.spin_once(0.01)
    for _ in range(MESSAGES_A_TURN + 1):
        publisher.publish(Bool())
    assert publisher.wait_for_all_acked()
    executor.spin_once()
    assert len(heard) == MESSAGES_A_TURN == 32
    executor.spin_once()
    assert len(heard) == MESSAGES_A_TURN + 1
    executor.shutdown()
    node.destroy_node()


LEAVING = """
import atexit, sys, time
from slip_detector.nodes.rclpy_internals import shut_down_and_exit

def taken_down():
    {hang}
    print('all is down', end='')

atexit.register(print, 'and more')
shut_down_and_exit(taken_down, 7)
"""

#: A call that waits with Python's lock held, so that no other thread runs.
LOCKED = 'import ctypes; ctypes.PyDLL(None).sleep(3600)'


@pytest.mark.parametrize(
    ('hang', 'code', 'said'),
    [('time.sleep(3600)', 7, ''), (LOCKED, -signal.SIGALRM, ''), ('pass', 7, 'all is down')],
)
def test_a_process_ends_when_all_is_down_even_if_the_middleware_hangs(hang, code, said):
    done = run_python('-c', LEAVING.format(hang=hang))
    assert (done.returncode, done.stdout) == (code, said), done.stderr
