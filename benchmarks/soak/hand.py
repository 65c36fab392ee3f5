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

import argparse
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

from benchmarks.noise import swelling_noise_v
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
SPIN_S = 0.2

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

    def has_samples(self, fingers: int) -> bool:
        """Return whether the detectors of this many fingers have received samples."""
        last = [reports[-1][1] for reports in self.reports.values()]
        return len(last) == fingers and all(int(values['samples']) > 0 for values in last)

    def spinner(self) -> Callable[[Callable[[], bool], float, str], None]:
        """Return a function that spins until a condition holds.

        It takes the condition, the latest time by ``time.monotonic``, and what is awaited; it
        raises a RuntimeError when a process ends or the time is over.
        """
        executor = SingleThreadedExecutor()
        executor.add_node(self)

        def spin(until: Callable[[], bool], deadline_s: float, awaited: str) -> None:
            while not until():
                raise_if_ended(self._processes)
                if time.monotonic() > deadline_s:
                    raise RuntimeError(f'waited in vain for {awaited}')
                executor.spin_once(timeout_sec=SPIN_S)

        return spin

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
    seconds: float, fingers: int, sample_rate_hz: float, samples_per_message: int
) -> dict[str, Any]:
    """Run the fingers; see :mod:`benchmarks.soak.measure`.

    Parameters
    ----------
    seconds
        How long the nodes run, warm-up included.
    fingers
        Number of drivers, and of detectors.
    sample_rate_hz
        At the rate of the simulated fingertip the drivers simulate it; at any other they play a
        recording.
    samples_per_message
        Parameter of the drivers.

    Returns
    -------
    dict
        The keys of ``hand``.

    Raises
    ------
    RuntimeError
        When a process ends too early or does not report in time.
    """
    namespace = f'/slip_soak_{os.getpid()}'
    driver = ['-p', 'loop:=true', '-p', 'wait_for_subscribers:=1']
    driver += ['-p', f'samples_per_message:={samples_per_message}']
    detector = ['-p', f'sample_rate_hz:={sample_rate_hz}']
    if samples_per_message > 1:
        detector += ['-p', 'input_type:=std_msgs/msg/Float32MultiArray', '-p', 'input_field:=data']
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        with tempfile.TemporaryDirectory() as folder:
            if sample_rate_hz != DetectorConfig().sample_rate_hz:
                path = write_noise(Path(folder), sample_rate_hz, seconds + NOISE_EXTRA_S)
                driver += ['-p', 'source:=recording', '-p', f'recording:={path}']
            else:
                driver += ['-p', 'source:=scene']
            commands = hand_commands(namespace, fingers, detector, driver)
            with nodes_running(commands) as processes:
                watch = Watch(namespace, processes)
                figures = _watched(watch, processes, seconds, fingers)
    finally:
        rclpy.try_shutdown()
    return {
        'sample_rate_hz': sample_rate_hz, 'samples_per_message': samples_per_message, **figures,
    }  # fmt: skip


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


def write_noise(folder: Path, sample_rate_hz: float, seconds: float) -> Path:
    """Write a recording of noise that swells and fades, so that decisions change."""
    config, rows = DetectorConfig(), round(seconds * sample_rate_hz)
    volts = swelling_noise_v(rows, config.channels, period_rows=sample_rate_hz)
    stamps_ns = np.round(np.arange(rows) * 1e9 / sample_rate_hz).astype(np.int64)
    path = folder / 'noise.npz'
    write_recording(path, [Samples(volts, stamps_ns)], sample_rate_hz, config.names)
    return path


def _watched(
    watch: Watch, processes: 'dict[str, subprocess.Popen[bytes]]', seconds: float, fingers: int
) -> dict[str, Any]:
    """Watch the processes for some time; return the figures of the time after the warm-up."""
    spin = watch.spinner()
    start_s = time.monotonic() + START_TIMEOUT_S
    spin(lambda: watch.has_samples(fingers), start_s, 'all detectors to have samples')
    begin_s = time.monotonic()
    warm_s = begin_s + min(WARM_UP_S, WARM_UP_SHARE * seconds)
    end_s = begin_s + seconds
    spin(lambda: time.monotonic() > warm_s, end_s, 'the warm-up')
    used_s = {name: processor_time_s(process.pid) for name, process in processes.items()}
    spin(lambda: time.monotonic() > end_s, end_s + START_TIMEOUT_S, 'the end')
    for name, process in processes.items():
        used_s[name] = processor_time_s(process.pid) - used_s[name]
    return figures_of_watch(watch, used_s, warm_s, end_s)


def figures_of_watch(
    watch: Watch, used_s: dict[str, float], warm_s: float, end_s: float
) -> dict[str, Any]:
    """Compute the figures of the time after the warm-up."""
    span_s = end_s - warm_s
    lost: dict[str, int] = dict.fromkeys(COUNT_KEYS.values(), 0)
    samples = 0
    p99_ms: list[tuple[float, float]] = []
    median_ms: list[float] = []
    for reports in watch.reports.values():
        samples += int(reports[-1][1]['samples'])
        for key in lost:
            lost[key] += int(reports[-1][1][key])
        for at_s, values in reports:
            if at_s > warm_s and values[AGE_KEYS[1]] != '-':
                median_ms.append(float(values[AGE_KEYS[0]]))
                p99_ms.append((at_s, float(values[AGE_KEYS[1]])))
    middle_s = (warm_s + end_s) / 2
    halves = [
        [value for at_s, value in p99_ms if (at_s < middle_s) == first] for first in (True, False)
    ]
    if not all(halves):
        raise RuntimeError('the detectors reported no samples after the warm-up')
    growth = [memory_growth(looks, warm_s, end_s) for looks in watch.memory_kib.values()]
    roles = {
        role: 100 * sum(s for name, s in used_s.items() if name.endswith(role)) / span_s
        for role in ('slip_detector', 'slip_driver')
    }
    return {
        'seconds': span_s,
        'fingers': len(watch.reports),
        'samples': samples,
        'lost': lost,
        'lost_total': sum(lost.values()),
        'latency_median_ms': float(np.median(median_ms)),
        'latency_p99_ms': [float(np.median(half)) for half in halves],
        'latency_p99_growth': float(np.median(halves[1]) / np.median(halves[0])),
        'memory_growth_percent': 100 * max(growth),
        'memory_mib': {
            role: max(
                looks[-1][1] for name, looks in watch.memory_kib.items() if name.endswith(role)
            )
            / 1024
            for role in roles
        },
        'cpu_percent': roles,
        'cpu_percent_total': sum(roles.values()),
    }


def memory_growth(looks: Sequence[tuple[float, float]], begin_s: float, end_s: float) -> float:
    """Return the relative growth of memory from the first tenth of a span of time to the last.

    Parameters
    ----------
    looks
        Times of the readings, and memory at each.
    begin_s, end_s
        Begin and end of the span.

    Examples
    --------
    >>> memory_growth([(1.0, 50), (11.0, 100), (12.0, 105), (13.0, 110)], 10.0, 20.0)
    0.1
    """
    during = [size for at_s, size in looks if begin_s < at_s <= end_s]
    tenth = max(1, len(during) // 10)
    return round(float(np.median(during[-tenth:]) / np.median(during[:tenth]) - 1.0), 6)


def main() -> int:
    """Run the hand, and print one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--seconds', type=float, default=600.0)
    parser.add_argument('--fingers', type=int, default=1)
    parser.add_argument('--sample-rate-hz', type=float, default=DetectorConfig().sample_rate_hz)
    parser.add_argument('--samples-per-message', type=int, default=1)
    words = parser.parse_args()
    return print_figures(lambda: run_hand(**vars(words)))


if __name__ == '__main__':
    sys.exit(main())
