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

"""What is published of the decisions, and in which order."""

import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header

from slip_detector.nodes.messages import event_qos, stamp_ns
from slip_detector.nodes.outputs import STATES, Outputs
from slip_detector.parameters.detector import DetectorConfig
from support.harness import patient_state_qos

#: One group of two channels; columns: slip, group, group can vote, channels, channels valid.
CONFIG = DetectorConfig(channels=3, groups={'front': (1, 2)}, disabled_channels=(3,))
ALL_ON = np.array([1, 1, 1, 1, 1, 0, 1, 1, 0], np.bool_)
AT_REST = np.array([0, 0, 1, 0, 0, 0, 1, 1, 0], np.bool_)
ONE_ON = np.array([0, 0, 1, 1, 0, 0, 1, 1, 0], np.bool_)

TOPICS = ('slip', 'slip_valid', 'slip/group/front', 'slip/channel/ch1', 'slip/channel/ch2')


class Published:
    """Outputs of a node of the test, and what is received of them in its order."""

    def __init__(self, bench, config=CONFIG):
        self.bench = bench
        self.heard = {topic: [] for topic in TOPICS}
        self.order = []
        for topic in TOPICS:
            bench.subscribe(
                Bool,
                topic,
                lambda message, topic=topic: self._note(topic, message.data),
                patient_state_qos(),
            )
        self.onsets = bench.listen(Header, 'slip_onset', event_qos())
        self.together = bench.listen(JointState, 'slip_state', patient_state_qos())
        self.outputs = Outputs(bench.node, config)
        bench.wait_for(
            lambda: (
                all([*self.heard.values(), self.together])
                and all(s.get_publisher_count() for s in bench.node.subscriptions)
            ),
            'the first states',
        )

    def _note(self, topic, state):
        self.heard[topic].append(state)
        self.order.append((topic, state))

    def announce(self, *rows):
        for k, flags in enumerate(rows):
            self.outputs.announce(flags, 1000 + k, 'tip')

    def states(self, **wanted):
        """Wait until the topics have had these states, and no others."""
        self.bench.wait_for(
            lambda: all(self.heard[t.replace('__', '/')] == s for t, s in wanted.items()),
            f'{wanted}, not {self.heard}',
        )


def test_decisions_are_published_when_they_change_and_repeated_by_the_heartbeat(bench):
    published = Published(bench)
    assert all(states == [False] for states in published.heard.values())
    published.announce(AT_REST, AT_REST, ONE_ON, ALL_ON, ALL_ON, AT_REST, ALL_ON)
    published.outputs.beat()
    assert (published.outputs.slip, published.outputs.valid) == (True, True)
    published.states(
        slip=[False, True, False, True, True],
        slip_valid=[False, True, True],
        slip__group__front=[False, True, False, True],
        slip__channel__ch1=[False, True, False, True],
        slip__channel__ch2=[False, True, False, True],
    )
    bench.wait_for(lambda: len(published.onsets) == 2, 'the onsets')
    bench.wait_for(lambda: len(published.together) == 6, 'slip, valid and onset together')
    assert {tuple(each.name) for each in published.together} == {STATES}
    assert [(stamp_ns(m.header.stamp), *m.position) for m in published.together[1:]] == [
        (1000, 0.0, 1.0, 0.0),
        (1003, 1.0, 1.0, 1003e-9),
        (1005, 0.0, 1.0, 1003e-9),
        *2 * [(1006, 1.0, 1.0, 1006e-9)],
    ]
    assert [stamp_ns(onset.stamp) for onset in published.onsets] == [1003, 1006]
    assert {onset.frame_id for onset in published.onsets} == {'tip'}
    assert published.outputs.onsets == 2


def test_what_is_withdrawn_is_first_not_valid_and_then_off(bench):
    published = Published(bench)
    published.announce(ALL_ON)
    published.outputs.withdraw()
    published.states(slip=[False, True, False], slip_valid=[False, True, False])
    order = published.order[len(TOPICS) :]
    # Of topics of their own the receiver may mix up the order; what is sent is in it.
    assert order.index(('slip_valid', True)) < order.index(('slip_valid', False))
    assert not published.outputs.valid
    bench.wait_for(lambda: published.together[-1].position[0] == 0.0, 'the state')
    assert published.together[-1].position[1] == 0.0
    assert stamp_ns(published.together[-1].header.stamp) > 10**18  # There is no sample any more.


def test_other_outputs_take_over_what_was_decided_and_the_topics_that_stay(bench):
    published = Published(bench)
    published.announce(ALL_ON)
    replaced = DetectorConfig(
        channels=3,
        groups={'back': (3,), 'front': (1, 2)},
        heartbeat_hz=20.0,
        publish_channels=False,
    )
    other = bench.listen(Bool, 'slip/group/back', patient_state_qos())
    outputs = published.outputs
    outputs.configure(replaced)
    assert (outputs.slip, outputs.valid, outputs.onsets) == (True, True, 1)
    # What is new says what holds, and so does what stays.
    bench.wait_for(lambda: other, 'the other group')
    assert [message.data for message in other] == [False]
    published.states(
        slip=[False, True, True],
        slip_valid=[False, True, True],
        slip__group__front=[False, True, True],
        slip__channel__ch1=[False, True, False],
    )
    # Slip, groups, groups can vote, channels, channels valid.
    outputs.announce(np.array([1, 0, 1, 1, 1, 1, 1, 0, 1, 1, 1], np.bool_), 2000, 'tip')
    published.states(slip=[False, True, True], slip__group__front=[False, True, True])
    names = dict(bench.node.get_publisher_names_and_types_by_node('bench', '/'))
    assert '/slip/group/back' in names
    assert not [name for name in names if name.startswith('/slip/channel')]
    assert len(bench.node.get_publishers_info_by_topic('slip')) == 1
    assert len(published.onsets) == 1


def test_slip_that_a_change_turns_on_is_no_onset(bench):
    published = Published(bench)
    published.outputs.announce(ALL_ON, 1000, 'tip', settled=False)
    published.announce(AT_REST, ALL_ON)
    published.states(slip=[False, True, False, True])
    bench.wait_for(lambda: published.onsets, 'the onset')
    assert [stamp_ns(onset.stamp) for onset in published.onsets] == [1001]
    assert published.outputs.onsets == 1


def test_disabled_channels_and_unwanted_topics_have_no_publisher(bench):
    published = Published(bench)
    names = dict(bench.node.get_publisher_names_and_types_by_node('bench', '/'))
    assert '/slip/channel/ch3' not in names
    assert '/slip/channel/ch2' in names
    published.outputs.destroy()
    names = dict(bench.node.get_publisher_names_and_types_by_node('bench', '/'))
    assert not [name for name in names if 'slip' in name or 'envelope' in name]
