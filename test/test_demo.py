"""The demonstration, run as a user runs it."""

import json
import os
import subprocess
import sys

import pytest
from harness import DEADLINE_S

from slip_detector.config import DetectorConfig

pytest.importorskip('rclpy', reason='needs rclpy')


@pytest.fixture(scope='module')
def finished(tmp_path_factory):
    out = tmp_path_factory.mktemp('demo')
    command = [sys.executable, '-m', 'slip_detector.nodes.demo', '--out', str(out)]
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(os.getpid() % 100 + 1)}
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        timeout=2 * DEADLINE_S,
        env=environment,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return out, done.stdout


def test_every_figure_is_there_and_plausible(finished):
    figures = json.loads((finished[0] / 'demo.json').read_text())
    assert list(figures['channel_delay_ms']) == list(DetectorConfig().names)
    assert list(figures['group_delay_ms']) == list(DetectorConfig().groups)
    channels = figures['channel_delay_ms'].values()
    # The plate moves for 2.5 s: all channels feel it, none before it starts.
    assert all(0.0 < delay < 2500.0 for delay in channels)
    mean = sum(channels) / len(channels)
    assert figures['mean_delay_ms'] == pytest.approx(mean, abs=0.01)
    assert min(channels) < figures['global_delay_ms'] <= max(figures['group_delay_ms'].values())
    assert 0.0 <= figures['false_positive_percent'] < 20.0
    assert 0.0 < figures['latency_ms']['median'] <= figures['latency_ms']['p99']


def test_the_table_names_every_channel_group_and_figure(finished):
    for word in ('ch16', 'TP', 'LU', 'mean', 'slip', 'False positives', 'p99'):
        assert word in finished[1]


def test_the_picture_is_a_picture(finished):
    assert (finished[0] / 'demo.png').read_bytes().startswith(b'\x89PNG')


def test_a_scene_that_is_not_there_ends_in_one_line():
    command = [sys.executable, '-m', 'slip_detector.nodes.demo', '--scene', 'moon']
    done = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False)
    assert done.returncode == 1
    assert 'Traceback' not in done.stderr
    assert "no scene 'moon', allowed: " in done.stderr
