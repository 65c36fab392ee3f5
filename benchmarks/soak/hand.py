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

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from benchmarks.measurement import swelling_noise_v
from benchmarks.processes import memory_kib, nodes_running, processor_time_s, spin_until
from slip_detector.chain.samples import Samples
from slip_detector.nodes.health import AGE_KEYS, EVENTS
from slip_detector.parameters import DetectorConfig
from slip_detector.recordings import write_recording

#: Time, in seconds, for the start: the first one compiles, which takes minutes on a busy machine.
START_TIMEOUT_S = 300.0
#: Seconds by which the recording outlasts the soak: it must not end, as a restart takes time.
NOISE_EXTRA_S = 60.0

#: Compiling and discovery have ended after a minute, or after this share of a short soak.
WARM_UP_S, WARM_UP_SHARE = 60.0, 0.2

#: Period at which what is watched is looked at otherwise, too.
PERIOD_S = 5.0


class Watch(Node):
    """Keeps the diagnostics of the detectors and the memory of all processes."""

    def __init__(self, namespace: str, processes: 'dict[str, subprocess.Popen[bytes]]') -> None:
        super().__init__('slip_watch', namespace=namespace)
        self._processes = processes
        # By detector: the values of each report.
        self._reports: dict[str, list[dict[str, str]]] = {}
        self._memory_kib: dict[str, list[float]] = {name: [] for name in processes}
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 100)
        self.create_timer(1.0, self._note_memory)

    def wait_for(
        self, holds: Callable[[], Any], awaited: str, timeout_s: float = START_TIMEOUT_S
    ) -> None:
        """Spin until a condition holds; see :func:`.spin_until`."""
        spin_until(self, self._processes, holds, time.monotonic() + timeout_s, awaited)

    def have_samples(self, fingers: int) -> bool:
        """Return whether the detectors of this many fingers have received samples."""
        last = [reports[-1] for reports in self._reports.values()]
        return len(last) == fingers and all(int(values['samples']) > 0 for values in last)

    def wait(self, seconds: float) -> None:
        """Spin for some time."""
        end_s = time.monotonic() + seconds
        self.wait_for(lambda: time.monotonic() >= end_s, 'the end', seconds + START_TIMEOUT_S)

    def figures(self, seconds: float, each: Callable[[], object] = bool) -> dict[str, Any]:
        """Watch for some time, and call a function every few seconds.

        Returns
        -------
        dict
            By executable, ``cpu_percent`` of a core, ``memory_mib`` and ``memory_growth_percent``;
            ``samples`` and ``lost_total`` since the start; and of the age of samples the
            ``latency_median_ms`` (of all seconds) and the ``latency_p99_ms`` (of the first and of
            the second half).

        Raises
        ------
        RuntimeError
            When no detector reports samples.
        """
        self._reports, self._memory_kib = {}, {name: [] for name in self._processes}
        begin_s, before_s = time.monotonic(), self._used_s()
        while (left_s := begin_s + seconds - time.monotonic()) > 0.0:
            self.wait(min(PERIOD_S, left_s))
            each()
        lasted_s, after_s = time.monotonic() - begin_s, self._used_s()
        reports = [
            [values for values in several if values[AGE_KEYS[0]] != '-']
            for several in self._reports.values()
        ]
        halves = (
            [values for of_one in reports for values in of_one[: len(of_one) // 2]],
            [values for of_one in reports for values in of_one[len(of_one) // 2 :]],
        )
        last = [of_one[-1] for of_one in reports if of_one]
        if not all(halves):
            raise RuntimeError('the detectors reported no samples')

        def median_ms(key: str, values: list[dict[str, str]]) -> float:
            return float(np.median([float(one[key]) for one in values]))

        return {
            'cpu_percent': {
                name: 100 * (after_s[name] - before_s[name]) / lasted_s for name in after_s
            },
            'memory_mib': {name: sizes[-1] / 1024 for name, sizes in self._memory_kib.items()},
            'memory_growth_percent': {
                name: growth_percent(sizes) for name, sizes in self._memory_kib.items()
            },
            'latency_median_ms': median_ms(AGE_KEYS[0], [*halves[0], *halves[1]]),
            'latency_p99_ms': [median_ms(AGE_KEYS[1], half) for half in halves],
            'samples': sum(int(values['samples']) for values in last),
            'lost_total': sum(int(values[key]) for values in last for key in EVENTS),
        }

    def _used_s(self) -> dict[str, float]:
        return {name: processor_time_s(each.pid) for name, each in self._processes.items()}

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            name, _, part = status.name.partition(': ')
            if not f'/{name}'.startswith(self.get_namespace()):
                continue
            values = {pair.key: pair.value for pair in status.values}
            if part == 'input':
                self._reports.setdefault(name, []).append(values)
            elif part == 'timing':  # Follows in the same message.
                self._reports[name][-1] |= values

    def _note_memory(self) -> None:
        for name, process in self._processes.items():
            self._memory_kib[name].append(memory_kib(process.pid))


def measure(
    seconds: float, fingers: int = 1, sample_rate_hz: float = 380.0, samples_per_message: int = 1
) -> dict[str, Any]:
    """Run the fingers, warm-up included, for some time; return the figures of the time after it.

    At the rate of the simulated fingertip the drivers simulate it; at any other they play a
    recording of noise that swells and fades, so that decisions change.

    Returns
    -------
    dict
        The figures of :meth:`Watch.figures`, the ``memory_growth_percent`` of the process that
        grew most, ``cpu_percent_total``, and ``latency_p99_growth``, the ratio of the two of
        ``latency_p99_ms``.

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
        options = ([word for one in node for word in ('-p', one)] for node in (detector, driver))
        with nodes_running(hand_commands(namespace, fingers, *options)) as processes:
            watch = Watch(namespace, processes)
            watch.wait_for(lambda: watch.have_samples(fingers), 'all detectors to have samples')
            warm_up_s = min(WARM_UP_S, WARM_UP_SHARE * seconds)
            watch.wait(warm_up_s)
            figures = watch.figures(seconds - warm_up_s)
    p99_ms = figures['latency_p99_ms']
    return {
        **figures,
        'latency_p99_growth': p99_ms[1] / p99_ms[0],
        'memory_growth_percent': max(figures['memory_growth_percent'].values()),
        'cpu_percent_total': sum(figures['cpu_percent'].values()),
    }


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


def growth_percent(sizes: Sequence[float]) -> float:
    """Return by how much memory has grown from the first tenth of its readings to the last.

    Examples
    --------
    >>> growth_percent([100, 105, 110])
    10.0
    """
    tenth = max(1, len(sizes) // 10)
    return round(100 * float(np.median(sizes[-tenth:]) / np.median(sizes[:tenth]) - 1.0), 4)
