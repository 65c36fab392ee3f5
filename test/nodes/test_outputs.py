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

from unittest.mock import Mock

import numpy as np
from std_msgs.msg import Bool

from slip_detector.nodes.messages import stamp_ns
from slip_detector.nodes.outputs import STATES, Outputs
from slip_detector.parameters.detector import DetectorConfig

#: One group of two channels; columns: slip, group, group can vote, channels, channels valid.
CONFIG = DetectorConfig(channels=3, groups={'front': (1, 2)}, disabled_channels=(3,))
ALL_ON = np.array([1, 1, 1, 1, 1, 0, 1, 1, 0], np.bool_)
AT_REST = np.array([0, 0, 1, 0, 0, 0, 1, 1, 0], np.bool_)
ONE_ON = np.array([0, 0, 1, 1, 0, 0, 1, 1, 0], np.bool_)


class Published:
    """Outputs of a node without middleware; its topics, and what they have said, in this order."""

    def __init__(self):
        self.topics, self.said = [], []
        node = Mock(create_publisher=self._create)
        node.destroy_publisher = lambda publisher: self.topics.remove(publisher.topic)
        node.get_clock.return_value.now.return_value.nanoseconds = 10**18
        self.outputs = Outputs(node, CONFIG)

    def _create(self, message_type, topic, qos):
        self.topics.append(topic)
        return Mock(topic=topic, publish=lambda message: self.said.append((topic, message)))

    def announce(self, *rows):
        for k, flags in enumerate(rows):
            self.outputs.announce(flags, 1000 + k, 'tip')

    def messages(self, topic):
        return [message for said, message in self.said if said == topic]

    def states(self):
        """Return what each topic of a decision has said, by topic."""
        topics = dict.fromkeys(topic for topic, message in self.said if isinstance(message, Bool))
        return {topic: [each.data for each in self.messages(topic)] for topic in topics}


def test_decisions_are_published_when_they_change_and_repeated_by_the_heartbeat():
    published = Published()
    topics = {'slip', 'slip_valid', 'slip/group/front', 'slip/channel/ch1', 'slip/channel/ch2'}
    assert published.states() == {topic: [False] for topic in topics}
    published.announce(AT_REST, AT_REST, ONE_ON, ALL_ON, ALL_ON, AT_REST, ALL_ON)
    published.outputs.beat()
    assert (published.outputs.slip, published.outputs.valid) == (True, True)
    assert published.states() == {
        'slip': [False, True, False, True, True],
        'slip_valid': [False, True, True],
        'slip/group/front': [False, True, False, True],
        'slip/channel/ch1': [False, True, False, True],
        'slip/channel/ch2': [False, True, False, True],
    }
    together = published.messages('slip_state')
    assert {tuple(each.name) for each in together} == {STATES}
    assert [(stamp_ns(each.header.stamp), *each.position) for each in together[1:]] == [
        (1000, 0.0, 1.0, 0.0),
        (1003, 1.0, 1.0, 1003e-9),
        (1005, 0.0, 1.0, 1003e-9),
        *2 * [(1006, 1.0, 1.0, 1006e-9)],
    ]
    onsets = published.messages('slip_onset')
    assert [stamp_ns(onset.stamp) for onset in onsets] == [1003, 1006]
    assert {onset.frame_id for onset in onsets} == {'tip'}
    assert published.outputs.onsets == 2


def test_what_is_decided_is_valid_last_and_what_is_withdrawn_is_not_valid_first():
    published = Published()
    published.announce(ALL_ON)
    assert published.said[-1] == ('slip_valid', Bool(data=True))
    published.said.clear()
    published.outputs.withdraw()
    assert [topic for topic, _ in published.said[:2]] == ['slip_valid', 'slip']
    assert not any(any(states) for states in published.states().values())
    assert not published.outputs.valid
    (together,) = published.messages('slip_state')
    assert list(together.position[:2]) == [0.0, 0.0]
    assert stamp_ns(together.header.stamp) == 10**18  # There is no sample any more.


def test_other_outputs_take_over_what_was_decided_and_the_topics_that_stay():
    published = Published()
    published.announce(ALL_ON)
    replaced = DetectorConfig(
        channels=3,
        groups={'back': (3,), 'front': (1, 2)},
        heartbeat_hz=20.0,
        publish_channels=False,
    )
    outputs = published.outputs
    outputs.configure(replaced)
    assert (outputs.slip, outputs.valid, outputs.onsets) == (True, True, 1)
    # What is new says what holds, and so does what stays.
    said = {
        'slip': [False, True, True],
        'slip_valid': [False, True, True],
        'slip/group/front': [False, True, True],
        'slip/group/back': [False],
        'slip/channel/ch1': [False, True, False],
        'slip/channel/ch2': [False, True, False],
    }
    assert published.states() == said
    # Slip, groups, groups can vote, channels, channels valid.
    outputs.announce(np.array([1, 0, 1, 1, 1, 1, 1, 0, 1, 1, 1], np.bool_), 2000, 'tip')
    assert published.states() == said
    assert not [topic for topic in published.topics if topic.startswith('slip/channel')]
    assert published.topics.count('slip') == 1
    assert len(published.messages('slip_onset')) == 1
