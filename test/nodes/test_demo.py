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

"""The demonstration, run as a user runs it."""

import json
import subprocess
import sys
import time

import numpy as np
import pytest

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.driver import DriverConfig
from slip_detector.recordings import open_recording
from slip_detector.sources import open_source
from support.harness import DEADLINE_S

rclpy = pytest.importorskip('rclpy', reason='needs rclpy')
pytest.importorskip('rosbags', reason='needs rosbags')

from sensor_msgs.msg import JointState  # noqa: E402

from slip_detector.nodes.demo import SlipRecorder  # noqa: E402
from slip_detector.nodes.messages import sensor_qos, time_message  # noqa: E402
from slip_detector.nodes.rclpy_internals import WaitSet  # noqa: E402

DEADLINE_NS = round(DEADLINE_S * 1e9)

#: For so long the recorder takes nothing.
HELD_UP_NS = 100_000_000


def played(out, *words):
    """Let a demonstration write to a folder and return what it prints."""
    command = [sys.executable, '-m', 'slip_detector.nodes.demo', '--out', str(out), *words]
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        timeout=2 * DEADLINE_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope='module')
def finished(tmp_path_factory):
    out = tmp_path_factory.mktemp('demo')
    return out, played(out, '--record', str(out / 'trial.mcap'))


def test_every_figure_is_there_and_plausible(finished):
    figures = json.loads((finished[0] / 'demo.json').read_text())
    assert list(figures['channel_delay_ms']) == list(DetectorConfig().names)
    assert list(figures['group_delay_ms']) == list(DetectorConfig().groups)
    assert figures['motion']['end_s'] - figures['motion']['start_s'] == pytest.approx(2.5, abs=0.1)
    channels = figures['channel_delay_ms'].values()
    # The plate moves for 2.5 s: all channels feel it, none before it starts.
    assert all(0.0 < delay < 2500.0 for delay in channels)
    mean = sum(channels) / len(channels)
    assert figures['mean_delay_ms'] == pytest.approx(mean, abs=0.01)
    assert min(channels) < figures['global_delay_ms'] <= max(figures['group_delay_ms'].values())
    assert 0.0 <= figures['false_positive_percent'] < 20.0
    assert 0.0 < figures['latency_ms']['median'] <= figures['latency_ms']['p99']


def test_what_the_recorder_does_meanwhile_is_no_latency(bench):
    rclpy.init(domain_id=bench.domain)
    try:
        recorder = SlipRecorder(DetectorConfig())
        publisher = bench.node.create_publisher(
            JointState, 'slip_demo/slip_detector/envelope', sensor_qos()
        )
        (subscription,) = (
            each for each in recorder.subscriptions if each.topic_name.endswith('envelope')
        )
        bench.wait_for(
            lambda: publisher.get_subscription_count() and subscription.get_publisher_count(),
            'the recorder',
        )
        message = JointState()
        sent_ns = time.time_ns()
        message.header.stamp = time_message(sent_ns)
        publisher.publish(message)
        assert WaitSet([subscription], [], recorder.context, at_most=1).wait(DEADLINE_NS)
        arrived_ns = time.time_ns()
        # It is long there when the recorder takes it.
        while time.time_ns() < arrived_ns + HELD_UP_NS:
            bench.executor.spin_once(timeout_sec=0.01)
        while not recorder.latencies_s:
            recorder.receive()
            recorder.read()
        recorder.stop()
        assert 0.0 < recorder.latencies_s[0] <= (arrived_ns - sent_ns) * 1e-9
    finally:
        rclpy.try_shutdown()


def test_the_table_names_every_channel_group_and_figure(finished):
    for word in ('ch16', 'TP', 'LU', 'mean', 'slip', 'False positives', 'p99'):
        assert word in finished[1]


def test_the_picture_is_a_picture(finished):
    assert (finished[0] / 'demo.png').read_bytes().startswith(b'\x89PNG')


def test_where_nothing_moves_delays_are_undefined_and_the_rest_is_told(tmp_path):
    text = played(tmp_path, '--scene', 'taps')
    assert 'first ON: undefined, as nothing moves' in text
    for word in ('False positives', '% of the rest', 'p99'):
        assert word in text
    figures = json.loads((tmp_path / 'demo.json').read_text())
    assert figures['motion'] is None
    assert set(figures['channel_delay_ms'].values()) == {None}
    assert set(figures['group_delay_ms'].values()) == {None}
    for name in ('mean_delay_ms', 'sd_delay_ms', 'global_delay_ms'):
        assert figures[name] is None
    assert 0.0 <= figures['false_positive_percent'] <= 100.0
    assert 0.0 < figures['latency_ms']['median'] <= figures['latency_ms']['p99']
    assert (tmp_path / 'demo.png').read_bytes().startswith(b'\x89PNG')


def test_the_recording_is_the_trial_with_its_labels(finished):
    wanted = open_source(DriverConfig(source='scene')).read(100_000)
    recording = open_recording(finished[0] / 'trial.mcap')
    pieces = list(recording.pieces(DetectorConfig().sample_rate_hz))
    assert np.concatenate([piece.volts for piece in pieces]).tobytes() == wanted.volts.tobytes()
    np.testing.assert_array_equal(np.concatenate([piece.truth for piece in pieces]), wanted.truth)
    assert recording.channel_names == DetectorConfig().names
    assert recording.counts.gaps == recording.counts.dropped == 0
    assert str(finished[0] / 'trial.mcap') in finished[1]


def test_a_recording_that_is_there_already_is_not_overwritten(tmp_path):
    path = tmp_path / 'a.npz'
    path.write_text('precious')
    command = [sys.executable, '-m', 'slip_detector.nodes.demo', '--record', str(path)]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=DEADLINE_S, check=False
    )
    assert done.returncode == 1
    assert done.stderr == f'slip_demo: {path}: already exists, allowed: a new path\n'
    assert path.read_text() == 'precious'


def test_a_scene_that_is_not_there_ends_in_one_line():
    command = [sys.executable, '-m', 'slip_detector.nodes.demo', '--scene', 'moon']
    done = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False)
    assert done.returncode == 1
    assert 'Traceback' not in done.stderr
    assert "no scene 'moon', allowed: " in done.stderr
