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

"""The detector as a managed node, by the lifecycle services."""

import pytest
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from std_msgs.msg import Bool

from slip_detector.nodes.messages import state_qos


def change(bench, transition):
    request = ChangeState.Request(transition=Transition(id=transition))
    return bench.ask(ChangeState, 'slip_detector/change_state', request).success


def state(bench):
    answer = bench.ask(GetState, 'slip_detector/get_state', GetState.Request())
    return answer.current_state.id


#: A detector whose chain cannot be built, as when memory runs out.
WITHOUT_MEMORY = """
import sys
from slip_detector.chain import live_chain
def fail(config):
    raise MemoryError('no memory for the chain')
live_chain.SlipChain = fail
from slip_detector.nodes.run import main
main('slip_detector')
"""


def test_a_manager_is_told_why_a_node_cannot_be_configured(bench):
    process = bench.start_python('-c', WITHOUT_MEMORY, '--ros-args', '-p', 'autostart:=false')
    assert not change(bench, Transition.TRANSITION_CONFIGURE)
    assert state(bench) == State.PRIMARY_STATE_UNCONFIGURED
    assert 'no memory for the chain' in process.log()


def connections(bench):
    """Return whether the detector has its topics, and whether it subscribes to samples."""
    hears = '/voltages' in bench.subscribed('slip_detector')
    names = dict(bench.node.get_publisher_names_and_types_by_node('slip_detector', '/'))
    topics = {name for name in names if 'slip' in name or 'diagnostics' in name}
    return bool(topics - {'/slip_detector/transition_event'}), hears


def test_a_manager_takes_the_node_through_its_life(bench):
    slip = bench.listen(Bool, 'slip', state_qos())
    process = bench.start('slip_detector', parameters={'autostart': 'false'})
    assert state(bench) == State.PRIMARY_STATE_UNCONFIGURED
    assert connections(bench) == (False, False)
    assert not change(bench, Transition.TRANSITION_ACTIVATE)
    assert state(bench) == State.PRIMARY_STATE_UNCONFIGURED

    # The connections after each transition.
    configured = Transition.TRANSITION_CONFIGURE, State.PRIMARY_STATE_INACTIVE, (True, False)
    active = Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_ACTIVE, (True, True)
    for transition, wanted, connected in (
        configured,
        active,
        (Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE, (True, False)),
        (Transition.TRANSITION_CLEANUP, State.PRIMARY_STATE_UNCONFIGURED, (False, False)),
        configured,
        active,
        (Transition.TRANSITION_ACTIVE_SHUTDOWN, State.PRIMARY_STATE_FINALIZED, (False, False)),
    ):
        assert change(bench, transition)
        assert state(bench) == wanted
        bench.wait_for(lambda has=connected: connections(bench) == has, 'the connections')
        slip.clear()
        bench.wait_for(lambda has=connected: not all(has) or len(slip) > 3, 'the heartbeat')
    assert 'Traceback' not in process.log()


@pytest.mark.parametrize('autostart', ['true', 'false'])
def test_filters_that_cannot_be_run_end_the_node_at_once_with_one_line(bench, autostart):
    # Legal as such, but the filter would be lost to round-off.
    given = {'autostart': autostart, 'passband_hz': [0.01, 0.0101]}
    words = ['parameter passband_hz: the filter with edges at 0.01']
    bench.check_refused('slip_detector', given, words)
