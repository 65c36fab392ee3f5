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

"""The detector node as a process of its own, fed over DDS."""

import dataclasses

import numpy as np
import pytest
from std_msgs.msg import Bool, Header

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.nodes.messages import event_qos, stamp_ns
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources import open_source
from support.harness import PERIOD_NS, ROOT, START_NS, Detected, patient_state_qos


@pytest.fixture(scope='module')
def rows():
    """The plate scene around the start of motion: rest, slip, rest, 1.3 s."""
    samples = open_source(DriverConfig(source='scene')).read(10_000)
    start = int(np.flatnonzero(samples.truth)[0])
    end = int(np.flatnonzero(samples.truth)[-1])
    return np.concatenate(
        [samples.volts[start - 60 : start + 180], samples.volts[end - 60 : end + 200]]
    )


def changes(states):
    """Drop the repeats of the heartbeat."""
    data = [message.data for message in states]
    return [b for a, b in zip([None, *data], data, strict=False) if a != b]


def offline(rows):
    """Run the same rows through the chain without ROS, from rest."""
    chain = SlipChain(DetectorConfig())
    chain.update(rows[:1])
    return chain.update(rows)


def test_every_topic_says_what_the_chain_decides(bench, rows):
    topics = {f'slip/group/{name}': [] for name in DetectorConfig().groups}
    topics.update({f'slip/channel/ch{i + 1}': [] for i in range(16)})
    heard = {topic: bench.listen(Bool, topic, patient_state_qos()) for topic in topics}
    onsets = bench.listen(Header, 'slip_onset', event_qos())
    detected = Detected(bench, parameters={'input_timeout_s': 60.0})
    bench.wait_for(lambda: all(heard.values()), 'the first state of each topic')
    begin = detected.settle(rows[0], START_NS, PERIOD_NS)
    detected.send_all(rows, begin, PERIOD_NS)

    result = offline(rows)
    columns = {'slip': result.slip}
    for g, name in enumerate(DetectorConfig().groups):
        columns[f'slip/group/{name}'] = result.groups[:, g]
    for c in range(16):
        columns[f'slip/channel/ch{c + 1}'] = result.channels[:, c]
    wanted = {
        topic: [False, *[bool(b) for a, b in zip([False, *on], on, strict=False) if a != b]]
        for topic, on in columns.items()
    }
    heard['slip'] = detected.slip
    bench.wait_for(
        lambda: all(changes(heard[topic]) == wanted[topic] for topic in wanted),
        'the changes of all topics',
    )
    assert sum(wanted['slip']) >= 1
    first = np.flatnonzero(np.diff(result.slip, prepend=False) & result.slip)
    bench.wait_for(lambda: len(onsets) == len(first), 'the onsets')
    assert [stamp_ns(onset.stamp) for onset in onsets] == [begin + PERIOD_NS * k for k in first]
    sent = detected.envelope[-len(rows) :]
    np.testing.assert_allclose(
        [message.position for message in sent], result.level, rtol=1e-9, atol=1e-9
    )
    np.testing.assert_array_equal([message.effort for message in sent], result.channels)
    assert list(sent[0].name) == list(DetectorConfig().names)


def test_messages_that_do_not_fit_are_dropped_and_the_chain_goes_on(bench, rows):
    detected = Detected(bench)
    names = [f'taxel_{i}' for i in range(16)]
    begin = detected.settle(rows[0], START_NS, PERIOD_NS)
    at_ns = begin
    for i, row in enumerate(rows):
        if i % 50 == 10:
            detected.send(row[:15], at_ns)
            detected.send(row, at_ns, names=names)
            detected.send(row + 1.0, at_ns - 5 * PERIOD_NS)
        at_ns = detected.send_all([row], at_ns, PERIOD_NS)
    wanted = offline(rows).level
    heard = [message.position for message in detected.envelope[-len(wanted) :]]
    np.testing.assert_allclose(heard, wanted, rtol=1e-9, atol=1e-9)
    log = detected.process.log()
    assert 'a message has 15 channels, allowed: 16: dropped' in log
    assert 'the channels of a message are taxel_0, ' in log
    assert 'the stamp of a message does not fit those before: dropped' in log


def test_the_shipped_file_holds_the_defaults_and_where_the_taxels_are():
    shipped = DetectorConfig.from_yaml(ROOT / 'config' / 'slip_detector.yaml')
    assert dataclasses.replace(shipped, taxel_positions_m=()) == DetectorConfig()
    assert len(shipped.taxel_positions_m) == 3 * shipped.channels
