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

"""The detector node against a bare relay node, for ``python -m benchmarks soak``.

There are three processes: the detector as it ships, a relay that runs no chain, and a meter that
sends the samples and receives ``slip`` from both. How they are compared, and why:

- The two nodes take turns within each sample period: sample k goes to the detector when it is due
  and to the relay half a period later, with the same content. Other load of the machine
  affects both alike, and neither works while the other does.
- The relay publishes a Bool on those samples on which the detector publishes a change, not on
  every sample: a Bool for every sample would cost the relay more than the chain costs the detector
  and make the ratio look better. What the relay has to publish is in ``effort`` of the messages to
  both nodes; the detector does not read that field. So the relay is the least that a node can do
  for the same input and output, and the detector's heartbeat, ``slip_valid`` and ``slip_onset``
  count against the detector.
- The detector has all topics and the chain that it ships with, but short windows and a
  threshold at which a tone within the band toggles ``slip`` about fifty times a second. Only one
  channel toggles, and its group with it, while the others of the group stay ON and all other
  channels OFF: so a change of ``slip`` brings one message on ``slip/group/*`` and one on
  ``slip/channel/*``, not twenty.
- The k-th change received belongs to the sample of the k-th change of the same chain, run offline
  on the same rows. Latency counts from just before that sample is given to ``publish``, not from
  its stamp: the meter is late by the same time for both, which would only bring the ratio closer
  to one.
- Processor time is the user and system time of the whole process over the measured span.
"""

import argparse
import os
import subprocess
import sys
import time
from typing import Any

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from benchmarks.processes import nodes_running, print_figures, raise_if_ended
from benchmarks.soak.latency import latencies_of_changes_ns
from benchmarks.soak.meter import BASELINE_V, NODES, REST_S, WARM_UP_S, Meter
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import DetectorConfig

Floats = NDArray[np.float64]

#: The parameters of the detector that differ from the defaults.
PARAMETERS = {
    'envelope_window_s': 0.008,
    'decision_window_s': 0.008,
    'threshold': 1.0,
}

TONE_HZ = 12.0
TOGGLING_V = 0.02
#: A tone of this amplitude is below the threshold only near its zero crossings, for a shorter time
#: than the windows.
STAYING_ON_V = 2.0
NOISE_V = 1e-4

START_TIMEOUT_S = 300.0
DRAIN_TIMEOUT_S = 5.0
SPIN_S = 0.05


def measure_end_to_end(seconds: float) -> dict[str, Any]:
    """Run detector, relay and meter.

    Parameters
    ----------
    seconds
        Length of the measured span.

    Returns
    -------
    dict
        The keys of ``relay`` in :mod:`benchmarks.soak.measure`.

    Raises
    ------
    RuntimeError
        When a process ends too early or does not answer in time.
    """
    config = DetectorConfig.from_parameters(PARAMETERS)
    rate_hz = config.sample_rate_hz
    warm_up = round(WARM_UP_S * rate_hz)
    rows = tone_v(config, warm_up + round(seconds * rate_hz))
    chain = SlipChain(config)
    chain.update(np.full((1, config.channels), BASELINE_V))
    slip = chain.update(rows).slip
    changes = np.flatnonzero(np.diff(slip, prepend=False))

    namespace = f'/slip_end_to_end_{os.getpid()}'
    parameters = [word for name in PARAMETERS for word in ('-p', f'{name}:={PARAMETERS[name]}')]
    commands = {
        'detector': ['slip_detector.nodes.run', 'slip_detector', *_ros(namespace, 'detector')],
        'relay': ['benchmarks.soak.relay', *_ros(namespace, 'relay')],
    }
    commands['detector'] += parameters
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        with nodes_running(
            {name: [sys.executable, '-m', *command] for name, command in commands.items()}
        ) as processes:
            pids = {name: process.pid for name, process in processes.items()}
            meter = Meter(namespace, rows, slip, config.names, rate_hz, pids)
            try:
                send_and_receive(meter, processes, len(rows) / rate_hz, len(changes))
            finally:
                meter.destroy_node()
        return _figures(meter, changes, slip[changes], warm_up, rate_hz)
    finally:
        rclpy.try_shutdown()


def tone_v(config: DetectorConfig, rows: int) -> Floats:
    """Return a tone that toggles one channel of the first group and keeps its other channels ON.

    Returns
    -------
    ndarray, shape (rows, channels)
        Volts.
    """
    random = np.random.default_rng(0)
    toggling, *staying_on = next(iter(config.groups.values()))
    amplitudes_v = np.zeros(config.channels)
    amplitudes_v[toggling - 1] = TOGGLING_V
    amplitudes_v[np.array(staying_on) - 1] = STAYING_ON_V
    tone = np.sin(2 * np.pi * TONE_HZ / config.sample_rate_hz * np.arange(rows))
    noise_v = NOISE_V * random.standard_normal((rows, config.channels))
    return np.asarray(BASELINE_V + np.outer(tone, amplitudes_v) + noise_v)


def _ros(namespace: str, name: str) -> list[str]:
    return ['--ros-args', '--log-level', 'warn', '-r', f'__ns:={namespace}/{name}']


def send_and_receive(
    meter: Meter, processes: 'dict[str, subprocess.Popen[bytes]]', tone_s: float, changes: int
) -> None:
    """Let the meter send the tone, and receive the answers.

    Raises
    ------
    RuntimeError
        When a process or the sending fails, or nothing comes in time.
    """
    executor = SingleThreadedExecutor()
    executor.add_node(meter)

    def spin(deadline_s: float, awaited: str) -> None:
        raise_if_ended(processes)
        if meter.error is not None:
            raise RuntimeError(f'sending failed: {meter.error}')
        if time.monotonic() > deadline_s:
            raise RuntimeError(f'waited in vain for {awaited}')
        executor.spin_once(timeout_sec=SPIN_S)

    deadline_s = time.monotonic() + START_TIMEOUT_S
    while not meter.connected.is_set():
        spin(deadline_s, 'the answers of both nodes')
    deadline_s = time.monotonic() + REST_S + tone_s + START_TIMEOUT_S
    while meter.thread.is_alive():
        spin(deadline_s, 'the last sample to be sent')
    # A change that has not come after this time is lost.
    drained_s = time.monotonic() + DRAIN_TIMEOUT_S
    while time.monotonic() < drained_s and any(
        len(received) < changes for received in meter.received.values()
    ):
        spin(deadline_s, 'the last changes')


def _figures(
    meter: Meter,
    changes: NDArray[np.int64],
    states: NDArray[np.bool_],
    warm_up: int,
    rate_hz: float,
) -> dict[str, Any]:
    """Compute latencies and processor times from what the meter noted."""
    counted = changes >= warm_up
    result: dict[str, Any] = {
        'rate_hz': rate_hz,
        'samples': len(meter.sent_ns['detector']) - warm_up,
        'changes': int(counted.sum()),
    }
    span_s = meter.measured_s[1] - meter.measured_s[0]
    for name in NODES:
        sent_ns = np.array(meter.sent_ns[name])[changes].tolist()
        matched = latencies_of_changes_ns(sent_ns, states.tolist(), meter.received[name])
        of_counted = [ns for ns, count in zip(matched, counted, strict=True) if count]
        latencies_ms = [ns * 1e-6 for ns in of_counted if ns is not None]
        if not latencies_ms:
            raise RuntimeError(f'no change of slip arrived from the {name}')
        used_s = meter.processor_times_s[name][1] - meter.processor_times_s[name][0]
        result[name] = {
            'median_ms': float(np.median(latencies_ms)),
            'p99_ms': float(np.percentile(latencies_ms, 99)),
            'cpu_percent': 100 * used_s / span_s,
            'lost': len(of_counted) - len(latencies_ms),
        }
    mine, theirs = result['detector'], result['relay']
    result['latency_ratio'] = mine['median_ms'] / theirs['median_ms']
    result['cpu_ratio'] = mine['cpu_percent'] / theirs['cpu_percent']
    return result


def main() -> int:
    """Measure, and print one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--seconds', type=float, default=20.0, help='measured time')
    words = parser.parse_args()
    return print_figures(lambda: measure_end_to_end(words.seconds))


if __name__ == '__main__':
    sys.exit(main())
