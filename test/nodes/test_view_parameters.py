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

"""The parameters of a real detector: read, set, saved, and a detector that is gone."""

import asyncio
import contextlib
import signal

import pytest
from rcl_interfaces.msg import ParameterEvent
from rclpy.qos import qos_profile_parameter_events

from slip_detector.nodes import view_fingers
from slip_detector.nodes.view_fingers import ParameterClient, changes_in
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.detectors import Reading
from slip_detector.view.parameters import typed


@pytest.fixture
def client_of(bench):
    """Return what makes a client of a detector; all are destroyed at the end."""
    made = []

    def make(of_node='/slip_detector'):
        made.append(ParameterClient(bench.node, of_node))
        return made[-1]

    yield make
    for client in made:
        client.destroy()


def read(client) -> Reading:
    """Read as soon as the detector answers: it may take its time to start."""

    async def until_there():
        while True:
            with contextlib.suppress(ValueError):
                return await client.read()

    return asyncio.run(asyncio.wait_for(until_there(), 90.0))


def test_all_parameters_are_read_and_set_or_refused_as_a_whole_and_events_report_them(
    bench, client_of
):
    bench.start('slip_detector', parameters={'exponent': 2})
    client = client_of()
    reading = read(client)
    wanted = {**DetectorConfig().to_parameters(), 'exponent': 2}
    assert {name: reading.values[name] for name in wanted} == wanted
    assert reading.values['use_sim_time'] is False
    assert 'autostart' in reading.read_only
    assert 'threshold' not in reading.read_only
    assert reading.meanings['threshold'].startswith('Level above which a channel is ON')
    events = bench.listen(ParameterEvent, '/parameter_events', qos_profile_parameter_events)
    bench.wait_for(
        lambda: bench.node.count_publishers('/parameter_events') > 1, 'the topic of events'
    )

    def set_all(**values):
        return asyncio.run(client.set({n.replace('__', '.'): v for n, v in values.items()}))

    assert set_all(threshold=typed('threshold', 'low'), gain=2.0) == (
        "parameter threshold is 'low', allowed: a number"
    )
    assert 'read-only' in set_all(autostart=False, gain=2.0)
    assert 'cannot be deleted' in set_all(gain=None)
    assert set_all(threshold=10**30) == ''
    assert 'cannot be sent' in set_all(input_field='\ud800')
    assert 'cannot be sent' in set_all(input_field={})
    bands = typed('stopbands_hz', '0.5, 7.25')
    assert set_all(threshold=1, stopbands_hz=bands, channel_names=[], noise_floor=[0.5]) == ''
    old = {f'groups__{name}': None for name in ('TP', 'TD', 'LR', 'LU')}
    assert set_all(channels=2, noise_floor=[1, 0.5], groups__front=[2, 1], **old) == ''
    values = read(client).values
    assert values['threshold'] == 1.0
    assert values['gain'] == 100.0
    assert values['stopbands_hz'] == [0.5, 7.25]
    assert {name for name in values if name.startswith('groups.')} == {'groups.front'}

    def changed():
        ours = [changes_in(event) for event in events if event.node == '/slip_detector']
        return {name: value for changes in ours for name, value in changes.items()}

    bench.wait_for(lambda: 'groups.front' in changed(), 'the event')
    assert (changed()['threshold'], changed()['groups.TP']) == (1.0, None)


def test_a_detector_that_hangs_or_is_gone_is_reported_within_the_deadline(
    bench, client_of, monkeypatch
):
    def wait_s(seconds):
        monkeypatch.setattr(view_fingers, 'ANSWER_S', seconds)

    process = bench.start('slip_detector')
    client = client_of()
    read(client)
    assert asyncio.run(client.set({'threshold': 0.25})) == ''
    process.signal(signal.SIGSTOP)
    wait_s(1.0)
    assert asyncio.run(client.set({'threshold': 0.75})) == (
        'nothing was changed: /slip_detector has not answered for 1 s'
    )
    process.signal(signal.SIGCONT)
    wait_s(60.0)
    # An answer that came too late is not taken for that to the next question.
    assert 'is -1' in asyncio.run(client.set({'threshold': -1}))
    assert read(client).values['threshold'] == 0.25
    ask = client._ask

    async def hangs_with_the_change(service, once=False, **fields):
        if once:
            process.signal(signal.SIGSTOP)
        return await ask(service, once=once, **fields)

    monkeypatch.setattr(client, '_ask', hangs_with_the_change)
    wait_s(1.0)
    assert asyncio.run(client.set({'threshold': 0.5})) == (
        'it is not known whether this was set: /slip_detector has not answered for 1 s'
    )
    process.signal(signal.SIGCONT)
    process.signal(signal.SIGTERM)
    assert process.wait() == 0
    words = asyncio.run(client_of().set({'threshold': 0.5}))
    assert words == 'nothing was changed: /slip_detector cannot be reached for 1 s'
