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

"""Detectors that come, go, change and die, as fingers; and the parameters of one."""

import asyncio
import contextlib
import itertools
import signal
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from slip_detector.nodes import view_fingers
from slip_detector.nodes.messages import event_qos, sensor_qos, state_qos
from slip_detector.nodes.view_fingers import RemoteDetector, RosDetectors
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.detectors import OUTSIDE, RESTART
from support.harness import DEADLINE_S, PERIOD_NS, START_NS, sample

INDEX = '/index/slip_detector'

#: Name of the node that subscribes.
PAGE = 'page_of_test'


class Watching:
    """The detectors, polled as the server does."""

    def __init__(self, bench):
        self.bench = bench
        self.node = Node(PAGE, context=bench.context, start_parameter_services=False)
        self.detectors = RosDetectors(self.node)
        self.watched = set()

    async def until(self, holds, what):
        deadline_s = time.monotonic() + DEADLINE_S
        while not holds():
            if time.monotonic() > deadline_s:
                logs = '\n'.join(process.log() for process in self.bench.processes)
                pytest.fail(f'waited in vain for {what}; the processes said:\n{logs}')
            self.detectors.watch(self.watched)
            self.detectors.poll()
            await asyncio.sleep(0.01)


def watching(bench, test):
    """Run a test with the detectors."""

    async def run():
        it = Watching(bench)
        try:
            await test(it)
        finally:
            it.detectors.close()
            it.node.destroy_node()

    asyncio.run(run())


def start(bench, finger, *words, **parameters):
    return bench.start('slip_detector', '-r', f'__ns:=/{finger}', *words, parameters=parameters)


def test_a_finger_has_the_levels_of_its_detector_and_the_diagnostics_of_its_nodes(bench):
    async def test(it):
        start(bench, 'index', '-r', 'voltages:=/raw/skin', channels=2, threshold=0.25)
        publisher = bench.node.create_publisher(JointState, '/raw/skin', sensor_qos())
        await it.until(lambda: INDEX in it.detectors.fingers, 'the finger')
        finger = it.detectors.fingers[INDEX]
        assert (finger.config.channels, finger.config.threshold) == (2, 0.25)
        it.watched = {INDEX}

        # At the rate of the detector; a channel that never changes would not be valid for long.
        stamps_ns = itertools.count(START_NS, PERIOD_NS)
        volts = itertools.cycle((4.3, 4.301))

        def heard():
            publisher.publish(sample([next(volts)] * 2, next(stamps_ns)))
            return finger.valid and len(finger.track.levels) and len(finger.track.samples)

        await it.until(heard, 'samples and levels')
        # Nodes that publish the samples are heard, too, and no other.
        others = bench.node.create_publisher(DiagnosticArray, '/diagnostics', event_qos())
        names = ('bench: sensor', 'index/camera: frames')
        array = DiagnosticArray(status=[DiagnosticStatus(name=name) for name in names])

        def labels():
            others.publish(array)
            return {each.name for each in finger.diagnostics}

        wanted = {'bench: sensor', 'input', 'timing', 'channels', 'decisions'}
        await it.until(lambda: labels() == wanted, 'all diagnostics')
        # Silent: slip_valid falls, and the detector says why.
        await it.until(lambda: not finger.valid, 'slip_valid to fall')
        await it.until(
            lambda: any('is the sensor plugged in' in each.message for each in finger.diagnostics),
            'the words',
        )
        assert not finger.silence()

    watching(bench, test)


def test_a_detector_whose_parameters_change_and_that_ends_and_comes_again(bench):
    async def test(it):
        detector = start(bench, 'index')
        await it.until(lambda: INDEX in it.detectors.fingers, 'the finger')
        assert not bench.subscribed(PAGE)
        await it.detectors.change(INDEX, {'threshold': 0.75}, 'page 1')
        with pytest.raises(ValueError, match='parameter threshold is -1, allowed: 1e-30 to 1e'):
            await it.detectors.change(INDEX, {'threshold': -1.0, 'gain': 5.0}, 'page 1')
        finger = it.detectors.fingers[INDEX]
        assert [change.by for change in finger.changes] == ['page 1']
        # Nobody watched: its parameters are read when somebody does.
        it.watched = {INDEX}
        await it.until(lambda: it.detectors.fingers[INDEX].config.threshold == 0.75, 'the change')
        groups = {f'groups.{name}': None for name in ('TP', 'TD', 'LR', 'LU')}
        bench.set_whole(INDEX, {'channels': 4, **groups})
        await it.until(lambda: it.detectors.fingers[INDEX].config.channels == 4, 'the channels')
        assert list(it.detectors.fingers[INDEX].config.groups) == ['all']
        assert [change.by for change in finger.changes] == ['page 1', OUTSIDE]
        # One that ends is gone, with its subscriptions; it may come again.
        detector.signal(signal.SIGINT)
        await it.until(lambda: INDEX not in it.detectors.fingers, 'it to go')
        assert [*it.detectors.gone] == [INDEX]
        await it.until(lambda: not bench.subscribed(PAGE), 'the end of the subscriptions')
        with pytest.raises(ValueError, match='is gone'):
            await it.detectors.change(INDEX, {'threshold': 0.75}, 'page 1')
        start(bench, 'index')
        await it.until(lambda: INDEX in it.detectors.fingers, 'it to come again')
        assert 'started again' in it.detectors.fingers[INDEX].description()['notice']
        assert finger.changes[-1].by == RESTART
        assert finger.to_undo()['threshold'] == 0.75

    watching(bench, test)


def test_a_scene_that_is_found_after_an_order_obeys_it(bench):
    async def test(it):
        assert not it.detectors.order(INDEX, 'slip')
        heard = bench.listen(String, '/index/scene_order', state_qos())
        bench.wait_for(lambda: heard, 'the order')
        assert heard == [String(data='slip')]
        assert it.detectors.order(INDEX)

    watching(bench, test)


def test_a_detector_of_another_version_is_refused_with_the_reason_and_not_shown(bench):
    async def test(it):
        values = dict.fromkeys(('sample_rate_hz', 'channels', 'threshold', 'heartbeat_hz'), -1.0)
        with pytest.raises(ValueError, match=r'parameter .* allowed: '):
            it.detectors._note(INDEX, values, RESTART)
        # Another node that publishes slip_onset is no detector.
        it.detectors._note('/relay', {'threshold': 1.0}, RESTART)
        assert not it.detectors.with_gone()

    watching(bench, test)


@pytest.fixture
def remote(bench):
    """The client of a detector."""
    remote = RemoteDetector(bench.node, '/slip_detector')
    yield remote
    remote.close()


def read(remote):
    """Read as soon as the detector answers: it may take its time to start."""

    async def until_there():
        while True:
            with contextlib.suppress(ValueError):
                return await remote.read()

    return asyncio.run(asyncio.wait_for(until_there(), 90.0))


def test_all_parameters_are_read_and_set_or_refused_as_a_whole(bench, remote):
    bench.start('slip_detector', parameters={'exponent': 2})
    wanted = DetectorConfig(exponent=2).to_parameters()
    assert wanted.items() <= read(remote).items()

    def set_all(values):
        return asyncio.run(remote.set(values))

    most = {'channels': 5_000, 'disabled_channels': list(range(17, 5_001))}
    most |= {'envelope_window_s': 60.0, 'sample_rate_hz': 5e4}
    for words, values in {
        "parameter threshold is 'low', allowed: a number": {'threshold': 'low', 'gain': 2.0},
        'read-only': {'autostart': False, 'gain': 2.0},
        'cannot be deleted': {'gain': None},
        'did you mean threshold': {'threshhold': 0.4, 'gain': 2.0},
        'installed message type': {'input_type': 'std_msgs/msg/__name__', 'gain': 2.0},
        'channels is 5000: .* GB of memory': most,
        "'utf-8' codec can't encode": {'input_field': '\ud800'},
        'cannot be sent to the detector': {'input_field': {}},
        'threshold is 1000.*, allowed: a number of 64 bits': {'threshold': 10**400},
        'noise_floor is 1000.*, allowed: a number of 64 bits': {'noise_floor': [1, 10**400]},
    }.items():
        with pytest.raises(ValueError, match=words):
            set_all(values)
    some = {'threshold': 1, 'stopbands_hz': [0.5, 7.25], 'channel_names': [], 'vote': 'mean'}
    some['noise_floor'] = [0.5]
    set_all(some)
    assert some.items() <= read(remote).items()
    others = {f'groups.{name}': None for name in ('TP', 'TD', 'LR', 'LU')} | {'channels': 2}
    others |= {'noise_floor': [1, 0.5], 'groups.front': [2, 1]}
    set_all(others)
    values = read(remote)
    assert (values['channels'], values['noise_floor']) == (2, [1.0, 0.5])
    assert (values['threshold'], values['gain']) == (1.0, 100.0)
    assert {name for name in values if name.startswith('groups.')} == {'groups.front'}


def test_a_detector_that_hangs_or_is_gone_is_reported_within_the_deadline(
    bench, remote, monkeypatch
):
    process = bench.start('slip_detector')
    read(remote)
    asyncio.run(remote.set({'threshold': 0.25}))
    process.signal(signal.SIGSTOP)
    monkeypatch.setattr(view_fingers, 'ANSWER_S', 1.0)
    with pytest.raises(ValueError, match='is not known whether this was set: /slip_detector has'):
        asyncio.run(remote.set({'threshold': 0.75}))
    process.signal(signal.SIGCONT)
    monkeypatch.setattr(view_fingers, 'ANSWER_S', 60.0)
    # An answer that came too late is not taken for that to the next question.
    with pytest.raises(ValueError, match='is -1'):
        asyncio.run(remote.set({'threshold': -1}))
    assert read(remote)['threshold'] == 0.75
    remote.close()
    with pytest.raises(ValueError, match='/slip_detector ended before it answered'):
        asyncio.run(remote.set({'threshold': 0.5}))
