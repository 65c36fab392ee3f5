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

"""The grasp controller as a process of its own, told by the test or by a real detector."""

import itertools
import signal
import time

import pytest
from sensor_msgs.msg import JointState

from slip_detector.nodes.grasp_controller import PERIODS_COUNTED
from slip_detector.nodes.messages import state_qos
from slip_detector.parameters.grasp import GraspConfig
from support.harness import Beating

#: Quick, so that no test has to wait.
QUICK = {
    'grip_n': 2.0,
    'limit_n': 9.0,
    'step_factor': 1.5,
    'closing_n_s': 50.0,
    'settle_s': 0.0,
    'relax_after_s': 0.1,
    'relax_n_s': 20.0,
    'deadline_s': 0.5,
}


class Controlled(Beating):
    """A controller process, the test in place of its detector."""

    def __init__(self, bench, **parameters):
        super().__init__(bench)
        self.forces = bench.listen(JointState, 'grip_force', state_qos(depth=1000))
        self.process = bench.start('grasp_controller', parameters={**QUICK, **parameters})
        bench.wait_for(lambda: bench.node.count_publishers('grip_force'), 'the controller')
        for says in self.says.values():
            bench.wait_for(says.get_subscription_count, 'the controller to connect')

    def force_n(self):
        return self.forces[-1].effort[0] if self.forces else None

    def close(self):
        self.wait_for(lambda: self.force_n() == QUICK['grip_n'], 'the grip to close')


def test_nothing_is_commanded_before_the_detector_is_heard_and_nothing_gripped_before_it_is_valid(
    bench,
):
    hand = Controlled(bench)
    hand.wait_for(lambda: 'waiting' in hand.process.log(), 'the controller', beating=False)
    for _ in range(20):
        bench.executor.spin_once(timeout_sec=0.02)
    assert not hand.forces
    hand.state['slip_valid'] = False
    hand.wait_for(lambda: len(hand.forces) > 20, 'commands')
    assert {message.effort[0] for message in hand.forces} == {0.0}
    hand.state['slip_valid'] = True
    hand.close()
    assert list(hand.forces[-1].name) == ['grip']
    assert hand.forces[-1].header.stamp.sec > 0


@pytest.mark.parametrize('why', ['not valid', 'silent'])
def test_a_slip_that_cannot_be_relied_on_is_answered_as_configured(bench, why):
    hand, beating = Controlled(bench, on_invalid='open'), why == 'not valid'
    hand.close()
    hand.say(slip=True)
    hand.wait_for(lambda: hand.force_n() > QUICK['grip_n'], 'a raise')
    hand.say(slip=False)
    hand.wait_for(lambda: 'raised' in hand.process.log(), 'the log')
    hand.state['slip_valid'] = not beating
    said = f'{why}): the grip opens'
    hand.wait_for(lambda: said in hand.process.log(), said, beating)
    hand.wait_for(lambda: hand.force_n() == 0.0, 'the grip to open', beating)


def test_a_stall_is_no_silence_and_no_command_is_faster_than_it_may_be_after_it(bench):
    closing_n_s = 0.4
    hand = Controlled(bench, closing_n_s=closing_n_s, on_invalid='open')

    def stall(beating):
        """Stop the controller for three times its deadline, and let it go on."""
        hand.process.signal(signal.SIGSTOP)
        until_s = time.monotonic() + 3 * QUICK['deadline_s']
        hand.wait_for(lambda: time.monotonic() > until_s, 'the stall', beating)
        hand.process.signal(signal.SIGCONT)

    hand.wait_for(lambda: (hand.force_n() or 0.0) > 0.1, 'the grip to begin to close')
    for _ in range(2):
        stall(beating=True)
        count = len(hand.forces)
        hand.wait_for(lambda count=count: len(hand.forces) > count + 50, 'commands')
    found = [message.effort[0] for message in hand.forces]
    assert found == sorted(found)
    assert 'cannot be relied on' not in hand.process.log()
    # A detector that dies meanwhile is noticed after it.
    stall(beating=False)
    hand.wait_for(lambda: hand.force_n() == 0.0, 'the grip to open', beating=False)
    assert 'silent' in hand.process.log()
    most_n = closing_n_s * PERIODS_COUNTED / GraspConfig().command_hz
    found = [message.effort[0] for message in hand.forces]
    assert max(abs(b - a) for a, b in itertools.pairwise(found)) <= most_n * (1 + 1e-9)
    assert max(found) < QUICK['grip_n']


def test_two_controllers_of_one_gripper_both_say_so(bench):
    first = bench.start('grasp_controller', parameters=QUICK)
    second = bench.start('grasp_controller', '-r', '__ns:=/other', '-r', 'grip_force:=/grip_force')
    said = '/grip_force is published by /grasp_controller, /other/grasp_controller: only one'
    for process in (first, second):
        bench.wait_for(lambda process=process: said in process.log(), 'the error')
