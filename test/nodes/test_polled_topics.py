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

"""Messages that are taken when somebody looks, in the order of the subscriptions."""

import pytest

rclpy = pytest.importorskip('rclpy', reason='needs rclpy')

from rclpy.node import Node  # noqa: E402
from std_msgs.msg import Bool  # noqa: E402

from slip_detector.nodes.messages import event_qos  # noqa: E402
from slip_detector.nodes.polled_topics import PolledTopics  # noqa: E402


def test_what_has_come_is_taken_and_nothing_after_the_end(bench):
    publishers = [bench.node.create_publisher(Bool, name, event_qos()) for name in ('a', 'b')]
    other = Node('other', context=bench.context)
    topics, taken = PolledTopics(other), []
    assert not topics
    topics.add(Bool, 'a', event_qos(), lambda message: taken.append(message.data))
    topics.add(Bool, 'b', event_qos(), lambda raw, info: taken.append((raw[-1], info)), raw=True)
    assert topics
    bench.wait_for(lambda: all(p.get_subscription_count() for p in publishers), 'subscriptions')
    publishers[1].publish(Bool(data=True))
    publishers[0].publish(Bool(data=False))

    def both():
        topics.poll()
        return len(taken) == 2

    bench.wait_for(both, 'both messages')
    assert False in taken
    ((last, info),) = [each for each in taken if each is not False]
    assert last == 1
    assert info['source_timestamp'] > 0
    topics.close()
    assert not topics
    bench.wait_for(lambda: not any(p.get_subscription_count() for p in publishers), 'the end')
    topics.poll()
    assert len(taken) == 2
    other.destroy_node()
