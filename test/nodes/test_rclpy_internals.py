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

import pytest

rclpy = pytest.importorskip('rclpy', reason='needs rclpy')

from builtin_interfaces.msg import Time  # noqa: E402
from lifecycle_msgs.msg import State, Transition  # noqa: E402
from lifecycle_msgs.srv import ChangeState  # noqa: E402
from rcl_interfaces.srv import GetParameters  # noqa: E402
from rclpy.clock import Clock, ClockType  # noqa: E402
from rclpy.exceptions import InvalidHandle  # noqa: E402
from rclpy.executors import ExternalShutdownException  # noqa: E402
from rclpy.lifecycle import LifecycleNode  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rosgraph_msgs.msg import Clock as ClockMessage  # noqa: E402
from std_msgs.msg import Bool  # noqa: E402

from slip_detector.nodes.messages import event_qos  # noqa: E402
from slip_detector.nodes.rclpy_internals import (  # noqa: E402
    SampleExecutor,
    answer_impossible_transitions,
    destroy_state_machine,
    given_parameters,
    ignore_impossible_times,
    receiver,
    send_request,
    take_answer,
)


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


def spin(executor):
    while True:
        executor.spin_once(0.1)


def test_messages_timers_and_services_are_served_and_calls_put_off_come_when_no_message_waits(
    context, node
):
    calls, client = [], node.create_client(GetParameters, 'of_answers/get_parameters')
    served = Node('of_answers', context=context)
    served.declare_parameter('gain', 2)
    executor = SampleExecutor([served])

    def on_said(message, info):
        calls.append(('said', info['publication_sequence_number']))
        executor.put_off(lambda: calls.append(('after', None)))

    served.create_subscription(Bool, 'said', on_said, event_qos())
    publisher = node.create_publisher(Bool, 'said', event_qos())
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    timer = served.create_timer(0.01, lambda: calls.append(('timer', None)), clock=steady)
    while not publisher.get_subscription_count() or not client.service_is_ready():
        executor.spin_once(0.01)
    for _ in range(3):
        publisher.publish(Bool())
    while len([kind for kind, _ in calls if kind == 'after']) < 3 or ('timer', None) not in calls:
        executor.spin_once(0.01)
    told = [call for call in calls if call[0] != 'timer']
    # Fast DDS numbers what a publisher sends.
    assert [number - told[0][1] for kind, number in told if kind == 'said'] == [0, 1, 2]
    served.destroy_timer(timer)
    asked, answer = [], None
    while answer is None:
        # An answer may be lost before the service knows the client.
        asked.append(send_request(client, GetParameters.Request(names=['gain'])))
        executor.spin_once(0.1)
        answer = take_answer(client)
    assert answer[0] in asked
    assert answer[1].values[0].integer_value == 2
    rclpy.try_shutdown(context=context)
    with pytest.raises(ExternalShutdownException):
        spin(executor)
    executor.shutdown()
    served.destroy_node()


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
