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
import itertools

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


def without_repeats(states):
    """Drop states that only repeat the one before, as the heartbeat does."""
    return [state for state, _ in itertools.groupby(map(bool, states))]


def offline(rows):
    """Run the same rows through the chain without ROS, from rest."""
    chain = SlipChain(DetectorConfig())
    chain.update(rows[:1])
    return chain.update(rows)


def test_every_topic_says_what_the_chain_decides_and_what_does_not_fit_is_dropped(bench, rows):
    result, config = offline(rows), DetectorConfig()
    columns = {f'slip/group/{name}': result.groups[:, g] for g, name in enumerate(config.groups)}
    columns |= {f'slip/channel/ch{c + 1}': result.channels[:, c] for c in range(16)}
    heard = {topic: bench.listen(Bool, topic, patient_state_qos()) for topic in columns}
    onsets = bench.listen(Header, 'slip_onset', event_qos())
    detected = Detected(bench, parameters={'input_timeout_s': 60.0})
    columns['slip'], heard['slip'] = result.slip, detected.slip
    bench.wait_for(lambda: all(heard.values()), 'the first state of each topic')
    begin = at_ns = detected.settle(rows[0], START_NS, PERIOD_NS)
    for i, row in enumerate(rows):
        if i % 50 == 10:
            detected.send(row[:15], at_ns)
            detected.send(row, at_ns, names=[f'taxel_{i}' for i in range(16)])
            detected.send(row + 1.0, at_ns - 5 * PERIOD_NS)
        at_ns = detected.send_all([row], at_ns, PERIOD_NS)

    wanted = {topic: without_repeats([False, *states]) for topic, states in columns.items()}
    assert sum(wanted['slip']) >= 1
    bench.wait_for(
        lambda: all(
            without_repeats(message.data for message in heard[topic]) == states
            for topic, states in wanted.items()
        ),
        'the changes of all topics',
    )
    first = np.flatnonzero(np.diff(result.slip, prepend=False) & result.slip)
    bench.wait_for(lambda: len(onsets) == len(first), 'the onsets')
    assert [stamp_ns(onset.stamp) for onset in onsets] == [begin + PERIOD_NS * k for k in first]
    sent = detected.envelope[-len(rows) :]
    levels = [message.position for message in sent]
    np.testing.assert_allclose(levels, result.level, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal([message.effort for message in sent], result.channels)
    assert list(sent[0].name) == list(config.names)
    log = detected.process.log()
    assert 'a message has 15 channels, allowed: 16: dropped' in log
    assert 'the channels of a message are taxel_0, ' in log
    assert 'the stamp of a message does not fit those before: dropped' in log


def test_the_shipped_file_holds_the_defaults_and_where_the_taxels_are():
    shipped = DetectorConfig.from_yaml(ROOT / 'config' / 'slip_detector.yaml')
    assert dataclasses.replace(shipped, taxel_positions_m=()) == DetectorConfig()
    assert len(shipped.taxel_positions_m) == 3 * shipped.channels
