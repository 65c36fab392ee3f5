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

"""Detectors that come, go, change and die, as fingers."""

import asyncio
import itertools
import signal
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from slip_detector.nodes.messages import event_qos, sensor_qos, state_qos
from slip_detector.nodes.view_fingers import RosDetectors
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

    def subscribed(self):
        """Return the topics that the page's node subscribes to."""
        found = self.bench.node.get_subscriber_names_and_types_by_node(PAGE, '/')
        return {topic for topic, _ in found}


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
        assert it.subscribed() == set()
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
        await it.until(lambda: not it.subscribed(), 'the end of the subscriptions')
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
