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

"""The meter: both nodes get every sample in turn, and their answers are noted."""

import os
import sys

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

import rclpy
from rclpy.signals import SignalHandlerOptions

from benchmarks.processes import CHECKOUT, nodes_running
from benchmarks.soak.end_to_end import send_and_receive
from benchmarks.soak.meter import NODES, WARM_UP_S, Meter

pytestmark = pytest.mark.nodes

RATE_HZ = 100.0


def test_each_of_two_relays_gets_every_sample_and_says_every_change(monkeypatch):
    monkeypatch.chdir(CHECKOUT)
    namespace = f'/meter_{os.getpid()}'
    states = np.arange(200) // 10 % 2 == 1
    changes = np.flatnonzero(np.diff(states, prepend=False))
    commands = {
        name: [
            sys.executable, '-m', 'benchmarks.soak.relay',
            '--ros-args', '-r', f'__ns:={namespace}/{name}',
        ]
        for name in NODES
    }  # fmt: skip
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        with nodes_running(commands) as processes:
            pids = {name: process.pid for name, process in processes.items()}
            rows = np.full((len(states), 2), 4.3)
            meter = Meter(namespace, rows, states, ('a', 'b'), RATE_HZ, pids)
            try:
                send_and_receive(meter, processes, len(states) / RATE_HZ, len(changes))
            finally:
                meter.destroy_node()
    finally:
        rclpy.try_shutdown()
    for name in NODES:
        assert len(meter.sent_ns[name]) == len(states)
        assert [state for _, state in meter.received[name]] == states[changes].tolist()
        assert len(meter.processor_times_s[name]) == 2
    # In turn: a sample to the one node, then the same to the other.
    first, second = (np.array(meter.sent_ns[name]) for name in NODES)
    assert np.all(first < second)
    assert np.all(second[:-1] < first[1:])
    span_s = meter.measured_s[1] - meter.measured_s[0]
    assert span_s == pytest.approx(len(states) / RATE_HZ - WARM_UP_S, rel=0.2)
