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

"""The detector node against a bare relay: its figures, and that nothing outlives it."""

import contextlib
import json
import os
import signal
import subprocess
import time
from pathlib import Path

import pytest

from benchmarks.soak import measure
from support.benchmarks import PATIENCE_S, run, start

pytest.importorskip('rclpy', reason='needs rclpy')

pytestmark = pytest.mark.nodes

END_PATIENCE_S = 60.0

#: How often it is looked whether processes have appeared.
LOOK_AGAIN_S = 0.1


def test_detector_and_relay_are_compared():
    code, output, errors = run('soak', '--quick', '--part', 'relay', '--json')
    assert code == 0, errors
    result = json.loads(output)
    part = result['relay']
    for name in part:
        assert f'``{name}``' in measure.__doc__
    assert part['samples'] == 4 * 380
    # The tone toggles slip four times a period.
    assert part['changes'] == pytest.approx(4 * 12 * 4, rel=0.1)
    for name in ('detector', 'relay'):
        node = part[name]
        assert set(node) == {'median_ms', 'p99_ms', 'cpu_percent', 'lost'}
        assert 0 < node['median_ms'] <= node['p99_ms']
        assert node['cpu_percent'] > 0
        assert node['lost'] < part['changes'] / 2
    assert part['latency_ratio'] == pytest.approx(
        part['detector']['median_ms'] / part['relay']['median_ms']
    )
    assert result['wanted']['relay.cpu_ratio']['value'] == part['cpu_ratio']


#: What the meter, the relay and the detector run.
MODULES = (b'benchmarks.soak.end_to_end', b'benchmarks.soak.relay', b'slip_detector.nodes')


def processes_marked(mark):
    """Return the processes that have inherited the environment of a run."""
    found = []
    for folder in Path('/proc').iterdir():
        with contextlib.suppress(OSError):  # Another user's, or gone meanwhile.
            words = (folder / 'cmdline').read_bytes()
            ours = any(module in words for module in MODULES)
            if ours and mark in (folder / 'environ').read_bytes():
                found.append(words)
    return found


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_leaves_no_process(number, monkeypatch):
    mark = f'SLIP_BENCHMARK_TEST={os.getpid()}-{number}'
    monkeypatch.setenv(*mark.split('='))
    process = start('soak', '--quick', '--part', 'relay')
    try:
        deadline_s = time.monotonic() + PATIENCE_S
        while len(processes_marked(mark.encode())) < 3:  # Meter, detector and relay.
            assert time.monotonic() < deadline_s
            # A process that appears gives no sign to wait for, one that ends does.
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(LOOK_AGAIN_S)
        process.send_signal(number)
        output, errors = process.communicate(timeout=END_PATIENCE_S)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == {signal.SIGINT: 130, signal.SIGTERM: 143}[number]
    assert 'Traceback' not in errors
    assert output == ''
    assert processes_marked(mark.encode()) == []
