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

"""The names of an input's channels, from message to message."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip('rclpy', reason='needs rclpy')

from slip_detector.nodes.channel_names import ChannelNames

NAMES = st.lists(st.text('abc', max_size=3), max_size=6)


@given(NAMES, st.lists(NAMES))
def test_the_names_of_the_first_message_are_those_of_all(first, others):
    names = ChannelNames(len(first))
    assert not names.refusal(first)
    for other in [*others, first]:
        assert (not names.refusal(other)) == (other == first)


def test_names_that_are_known_beforehand_are_kept_from_the_first_message_on():
    names = ChannelNames(2, ('left', 'right'))
    assert names.refusal([]) == (
        'the channels of a message are without names, allowed: left, right'
    )
    assert not names.refusal(['left', 'right'])


def test_another_number_of_names_is_refused_and_forgotten():
    names = ChannelNames(6)
    assert names.refusal(list('abcde')) == (
        'the channels of a message are a, b, c, d, ... (5), allowed: 6 names'
    )
    assert not names.refusal(list('uvwxyz'))


def test_messages_without_names_go_with_each_other_only():
    names = ChannelNames(2)
    assert not names.refusal([])
    assert names.refusal(['a', 'b']).endswith('allowed: without names')
