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

"""The processes of a soak: drivers and detectors of all fingers, watched by their diagnostics.

Losses are counted by the detectors, from the stamps of the samples or the numbers of messages
without stamps: samples that are bridged or dropped, and new stretches. So no other process has to
receive the samples.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from benchmarks.measurement import swelling_noise_v
from benchmarks.processes import (
    memory_kib,
    nodes_running,
    print_figures,
    processor_time_s,
    raise_if_ended,
)
from slip_detector.chain.samples import Samples
from slip_detector.nodes.health import AGE_KEYS, COUNT_KEYS
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.recordings import write_recording

#: Time, in seconds, for the start: the first one compiles, which takes minutes on a busy machine.
START_TIMEOUT_S = 300.0
#: Seconds by which the recording outlasts the soak: it must not end, as a restart takes time.
NOISE_EXTRA_S = 60.0

#: Compiling and discovery have ended after a minute, or after this share of a short soak.
WARM_UP_S, WARM_UP_SHARE = 60.0, 0.2


class Watch(Node):
    """Keeps the diagnostics of the detectors and the memory of all processes."""

    def __init__(self, namespace: str, processes: 'dict[str, subprocess.Popen[bytes]]') -> None:
        super().__init__('slip_watch', namespace=namespace)
        self._processes = processes
        # By detector: the values of each report, and when it was received.
        self.reports: dict[str, list[tuple[float, dict[str, str]]]] = {}
        self.memory_kib: dict[str, list[tuple[float, int]]] = {name: [] for name in processes}
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 100)
        self.create_timer(1.0, self._note_memory)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self)

    def has_samples(self, fingers: int) -> bool:
        """Return whether the detectors of this many fingers have received samples."""
        last = [reports[-1][1] for reports in self.reports.values()]
        return len(last) == fingers and all(int(values['samples']) > 0 for values in last)

    def spin(self, until: Callable[[], bool], deadline_s: float, awaited: str) -> None:
        """Spin until a condition holds, at the latest at a time of ``time.monotonic``.

        Raises
        ------
        RuntimeError
            When a process ends or the time is over.
        """
        while not until():
            raise_if_ended(self._processes)
            if time.monotonic() > deadline_s:
                raise RuntimeError(f'waited in vain for {awaited}')
            self._executor.spin_once(timeout_sec=0.2)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            name, _, part = status.name.partition(': ')
            if part == 'input' and f'/{name}'.startswith(self.get_namespace()):
                values = {pair.key: pair.value for pair in status.values}
                self.reports.setdefault(name, []).append((time.monotonic(), values))

    def _note_memory(self) -> None:
        for name, process in self._processes.items():
            self.memory_kib[name].append((time.monotonic(), memory_kib(process.pid)))


def run_hand(
    seconds: float, fingers: int = 1, sample_rate_hz: float = 380.0, samples_per_message: int = 1
) -> dict[str, Any]:
    """Run the fingers, warm-up included, for some time; return the figures of the time after it.

    At the rate of the simulated fingertip the drivers simulate it; at any other they play a
    recording of noise that swells and fades, so that decisions change.

    Returns
    -------
    dict
        ``seconds`` measured after the warm-up, ``fingers``, ``sample_rate_hz``,
        ``samples_per_message``, ``samples``, ``lost`` (by kind) and ``lost_total``,
        ``latency_median_ms``, ``latency_p99_ms`` (of the first and of the second half: the median
        of the 99th percentiles of all seconds) and ``latency_p99_growth``, their ratio,
        ``memory_growth_percent`` (of the process that grew most), ``memory_mib`` and
        ``cpu_percent`` by executable, and ``cpu_percent_total``.

    Raises
    ------
    RuntimeError
        When a process ends too early or does not report in time.
    """
    namespace = f'/slip_soak_{os.getpid()}'
    driver = ['loop:=true', 'wait_for_subscribers:=1']
    driver += [f'samples_per_message:={samples_per_message}']
    detector = [f'sample_rate_hz:={sample_rate_hz}']
    if samples_per_message > 1:
        detector += ['input_type:=std_msgs/msg/Float32MultiArray', 'input_field:=data']
    config = DetectorConfig()
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        with tempfile.TemporaryDirectory() as folder:
            if sample_rate_hz != config.sample_rate_hz:
                rows = round((seconds + NOISE_EXTRA_S) * sample_rate_hz)
                volts = swelling_noise_v(rows, config.channels, period_rows=sample_rate_hz)
                stamps_ns = np.round(np.arange(rows) * 1e9 / sample_rate_hz).astype(np.int64)
                path = Path(folder) / 'noise.npz'
                write_recording(path, [Samples(volts, stamps_ns)], sample_rate_hz, config.names)
                driver += ['source:=recording', f'recording:={path}']
            else:
                driver += ['source:=scene']
            options = (
                [word for one in node for word in ('-p', one)] for node in (detector, driver)
            )
            commands = hand_commands(namespace, fingers, *options)
            with nodes_running(commands) as processes:
                figures = _watched(Watch(namespace, processes), processes, seconds, fingers)
    finally:
        rclpy.try_shutdown()
    rates = {'sample_rate_hz': sample_rate_hz, 'samples_per_message': samples_per_message}
    return rates | figures


def hand_commands(
    namespace: str, fingers: int, detector: Sequence[str], driver: Sequence[str]
) -> dict[str, list[str]]:
    """Return the commands of the detectors and of the drivers of a hand, by executable.

    Parameters
    ----------
    namespace, fingers
        The hand's namespace, and the number of its fingers, each with a namespace within it.
    detector, driver
        ROS arguments.
    """
    names = ','.join(f'finger_{finger + 1}' for finger in range(fingers))
    commands = {}
    for name, arguments in (('slip_detector', detector), ('slip_driver', driver)):
        command = [sys.executable, '-m', 'slip_detector.nodes.run', name]
        command += ['--fingers', names, '--ros-args', '--log-level', 'error']
        commands[name] = [*command, '-r', f'__ns:={namespace}', *arguments]
    return commands


def _watched(
    watch: Watch, processes: 'dict[str, subprocess.Popen[bytes]]', seconds: float, fingers: int
) -> dict[str, Any]:
    """Watch the processes for some time; return the figures of the time after the warm-up."""
    start_s = time.monotonic() + START_TIMEOUT_S
    watch.spin(lambda: watch.has_samples(fingers), start_s, 'all detectors to have samples')
    begin_s = time.monotonic()
    warm_s = begin_s + min(WARM_UP_S, WARM_UP_SHARE * seconds)
    end_s = begin_s + seconds
    watch.spin(lambda: time.monotonic() > warm_s, end_s, 'the warm-up')
    used_s = {name: -processor_time_s(process.pid) for name, process in processes.items()}
    watch.spin(lambda: time.monotonic() > end_s, end_s + START_TIMEOUT_S, 'the end')
    for name, process in processes.items():
        used_s[name] += processor_time_s(process.pid)

    reports = watch.reports.values()
    totals = [values[-1][1] for values in reports]
    lost = {key: sum(int(values[key]) for values in totals) for key in COUNT_KEYS.values()}
    ages_ms = [
        (at_s, float(values[AGE_KEYS[0]]), float(values[AGE_KEYS[1]]))
        for report in reports
        for at_s, values in report
        if at_s > warm_s and values[AGE_KEYS[1]] != '-'
    ]
    middle_s = (warm_s + end_s) / 2
    halves = [
        [age[2] for age in ages_ms if (age[0] < middle_s) == first] for first in (True, False)
    ]
    if not all(halves):
        raise RuntimeError('the detectors reported no samples after the warm-up')
    p99_ms = [float(np.median(half)) for half in halves]
    growths = [memory_growth(sizes, warm_s, end_s) for sizes in watch.memory_kib.values()]
    percent = {name: 100 * used / (end_s - warm_s) for name, used in used_s.items()}
    return {
        'seconds': end_s - warm_s,
        'fingers': len(watch.reports),
        'samples': sum(int(values['samples']) for values in totals),
        'lost': lost,
        'lost_total': sum(lost.values()),
        'latency_median_ms': float(np.median([age[1] for age in ages_ms])),
        'latency_p99_ms': p99_ms,
        'latency_p99_growth': p99_ms[1] / p99_ms[0],
        'memory_growth_percent': 100 * max(growths),
        'memory_mib': {name: sizes[-1][1] / 1024 for name, sizes in watch.memory_kib.items()},
        'cpu_percent': percent,
        'cpu_percent_total': sum(percent.values()),
    }


def memory_growth(sizes: Sequence[tuple[float, float]], begin_s: float, end_s: float) -> float:
    """Return the relative growth of memory from the first tenth of a span of time to the last.

    Parameters
    ----------
    sizes
        Times of the readings, and memory at each.
    begin_s, end_s
        Begin and end of the span.

    Examples
    --------
    >>> memory_growth([(1.0, 50), (11.0, 100), (12.0, 105), (13.0, 110)], 10.0, 20.0)
    0.1
    """
    during = [size for at_s, size in sizes if begin_s < at_s <= end_s]
    tenth = max(1, len(during) // 10)
    return round(float(np.median(during[-tenth:]) / np.median(during[:tenth]) - 1.0), 6)


if __name__ == '__main__':
    sys.exit(print_figures(lambda: run_hand(**json.loads(sys.argv[1]))))
