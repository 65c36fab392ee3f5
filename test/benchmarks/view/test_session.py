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

"""What the turns of the measurement come to."""

import os
import signal
import subprocess
import sys

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from benchmarks.processes import processor_time_s
from benchmarks.view.session import answers, children_s, figures_of_turns, free_port
from slip_detector.nodes.health import AGE_KEYS
from support.simulated_detectors import SimulatedDetectors, served_beside

pytestmark = pytest.mark.nodes


def turn(who, begin_s, seconds=10.0, used_s=1.0, drawn=(), heap=()):
    return {
        'who': who,
        'begin_s': begin_s,
        'end_s': begin_s + seconds,
        'used_s': {'slip_view': used_s, 'slip_detector': 2.0, 'slip_driver': 0.0},
        'browser_s': 6.0,
        'drawn_ms': list(drawn),
        'heap_mib': list(heap),
    }


def reports(ages):
    """Return reports of a finger: at each time the median; a 99th percentile of twice that."""
    return {
        'finger_1/slip_detector': [
            (at_s, {AGE_KEYS[0]: str(ms), AGE_KEYS[1]: str(2 * ms)}) for at_s, ms in ages
        ]
    }


TURNS = [
    turn('closed', 0.0, used_s=0.1),
    turn('elsewhere', 20.0, drawn=[0.0, 500.0, 1000.0]),
    turn('here', 40.0, used_s=3.0, drawn=range(0, 10_001, 50), heap=[(0.0, 4.0), (10.0, 5.0)]),
    turn('closed', 60.0, used_s=0.3),
]
AGES = [(0.5, 99.0), (5.0, 1.0), (25.0, 1.5), (45.0, 4.0), (55.0, 99.0), (65.0, 3.0)]
MEMORY_KIB = {'slip_view': [(5.0, 1024), (42.0, 2048), (49.0, 3072), (65.0, 4096)]}


def test_turns_of_one_kind_are_put_together_and_what_is_between_turns_is_left_out():
    figures = figures_of_turns(TURNS, reports(AGES), MEMORY_KIB)
    closed, elsewhere, here = (figures[who] for who in ('closed', 'elsewhere', 'here'))
    assert closed['seconds'] == 20.0
    assert closed['slip_view_cpu_percent'] == pytest.approx(2.0)
    assert (closed['latency_median_ms'], closed['latency_p99_ms']) == (2.0, 4.0)
    assert closed['latency_noise'] == 3.0
    assert elsewhere['latency_ratio'] == 0.75
    assert elsewhere['frames_a_second'] == 2.0
    assert here['latency_ratio'] == 2.0
    assert here['cpu_percent'] == {'slip_view': 30.0, 'slip_detector': 20.0, 'slip_driver': 0.0}
    assert here['browser_cpu_percent'] == 60.0
    assert (here['frames_a_second'], here['frames_in_the_worst_second']) == (20.0, 20.0)
    assert here['memory_mib'] == 4.0
    assert here['memory_growth_percent'] == pytest.approx(50.0)
    assert here['heap_growth_percent'] == pytest.approx(25.0)


def test_detectors_that_report_nothing_in_a_turn_are_an_error():
    with pytest.raises(RuntimeError, match='no samples in the turn here'):
        figures_of_turns(TURNS, reports(AGES[:3]), MEMORY_KIB)


def test_a_page_is_there_or_not():
    assert not answers(f'http://127.0.0.1:{free_port()}/')
    with served_beside(SimulatedDetectors()) as served:
        assert answers(served.url)


def test_the_time_of_processes_below_is_counted_but_for_some():
    busy = 'import time\nwhile time.process_time() < 0.2: pass\nprint(flush=True); time.sleep(99)'
    inner = f'import subprocess, sys; subprocess.run([sys.executable, "-c", {busy!r}])'
    outer = subprocess.Popen(
        [sys.executable, '-c', inner], stdout=subprocess.PIPE, start_new_session=True
    )
    try:
        outer.stdout.readline()
        assert children_s([]) > 0.15 + processor_time_s(outer.pid)
        assert children_s([outer.pid]) < 0.15
    finally:
        os.killpg(outer.pid, signal.SIGKILL)
        outer.communicate()


def test_a_free_port_is_one_that_can_be_had():
    assert len({free_port() for _ in range(5)}) > 1
