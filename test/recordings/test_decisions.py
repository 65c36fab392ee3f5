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

"""Decisions in a bag: what was last written on a topic is what was decided on the row."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

pytest.importorskip('rosbags', reason='needs rosbags')

from rosbags.highlevel import AnyReader

from slip_detector.chain.layout import flag_layout
from slip_detector.chain.samples import Samples
from slip_detector.chain.slip_chain import SlipResult
from slip_detector.parameters.detector import ChainConfig
from slip_detector.recordings.decisions import write_decisions

CONFIG = ChainConfig(
    sample_rate_hz=100.0, channels=3, groups={'a': (1,), 'b': (3,)}, disabled_channels=(2,),
    passband_hz=(5.0, 20.0), stopbands_hz=(),
)  # fmt: skip
PERIOD_NS = 10_000_000

#: The topic of a decision, and its column in the flags of a result.
COLUMNS = {'slip': 0, 'slip/group/a': 1, 'slip/group/b': 2, 'slip/channel/ch1': 5} | {
    'slip/channel/ch3': 7
}


def messages(path, namespace):
    """Return the times and messages of each topic."""
    found = {}
    with AnyReader([path]) as bag:
        for of, at_ns, raw in bag.messages():
            message = bag.deserialize(raw, of.msgtype)
            topic = of.topic.removeprefix(f'{namespace}/')
            found.setdefault(topic, []).append((at_ns, message))
    return {topic: tuple(zip(*several, strict=True)) for topic, several in found.items()}


@given(st.data())
def test_the_last_message_of_each_topic_is_the_decision_on_the_row(tmp_path_factory, data):
    path = tmp_path_factory.mktemp('decisions') / data.draw(st.sampled_from(['a.mcap', 'a']))
    n, namespace = data.draw(st.integers(1, 30)), data.draw(st.sampled_from(['', '/left']))
    flags = data.draw(hnp.arrays(np.bool_, (n, 11)))
    flags[:, 9] = False
    levels = np.arange(3.0 * n).reshape(n, 3)
    cut = data.draw(st.integers(0, n))
    is_gap = 0 < cut < n and data.draw(st.booleans())
    stamps_ns = 1_700_000_000_000_000_000 + PERIOD_NS * np.arange(n)
    stamps_ns[cut:] += 1_000_000_000 * is_gap
    pieces = [
        (
            Samples(np.zeros((b - a, 3)), stamps_ns[a:b], new_stretch=is_gap and a > 0),
            SlipResult(flags[a:b], levels[a:b], flag_layout(CONFIG), (False, True, False, False)),
        )
        for a, b in ((0, cut), (cut, n))
    ]
    write_decisions(path, pieces, CONFIG, namespace)
    found = messages(path, namespace)
    assert {*found} - {'slip_onset'} == {
        *COLUMNS, 'slip_valid', 'slip_state', 'slip_detector/envelope'
    }  # fmt: skip

    def last(topic, at_ns):
        times_ns, several = found[topic]
        return several[np.searchsorted(times_ns, at_ns, 'right') - 1]

    valid, onset_ns = flags[:, 3:5].any(axis=1), 0
    for k, at_ns in enumerate(stamps_ns.tolist()):
        decided = {topic: last(topic, at_ns).data for topic in [*COLUMNS, 'slip_valid']}
        wanted = {topic: flags[k, column] for topic, column in COLUMNS.items()}
        assert decided == {**wanted, 'slip_valid': valid[k]}
        if flags[k, 0] and (k == 0 or not flags[k - 1, 0] or (is_gap and k == cut)):
            onset_ns = at_ns
            assert at_ns in found['slip_onset'][0]
        state = last('slip_state', at_ns).position.tolist()
        assert state == [flags[k, 0], valid[k], onset_ns * 1e-9]
    if is_gap:
        after_ns = int(stamps_ns[cut - 1]) + PERIOD_NS
        assert not any(last(topic, after_ns).data for topic in [*COLUMNS, 'slip_valid'])
    times_ns, shown = found['slip_detector/envelope']
    assert [*times_ns] == stamps_ns.tolist()
    np.testing.assert_array_equal([one.effort for one in shown], flags[:, 5:8])
    np.testing.assert_array_equal(
        [one.position for one in shown], np.where(flags[:, 8:], levels, np.nan)
    )
    headers = [one.header for one in shown] + [*found.get('slip_onset', ((), ()))[1]]
    stamps = [one.stamp.sec * 1_000_000_000 + one.stamp.nanosec for one in headers]
    assert stamps == [*times_ns, *found.get('slip_onset', ((), ()))[0]]
