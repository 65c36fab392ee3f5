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

"""``slip_demo``: driver and detector as two processes, and what a grasp controller would get."""

import argparse
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.chain.samples import Samples
from slip_detector.evaluation.figures import first_on_delay_s, mean_and_sd, percent
from slip_detector.nodes.demonstration import (
    START_TIMEOUT_S,
    NodeProcesses,
    run_demonstration,
)
from slip_detector.nodes.messages import sensor_qos, stamp_ns, state_qos
from slip_detector.nodes.rclpy_internals import SampleExecutor
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.driver import DriverConfig
from slip_detector.parameters.files import shared_folder, whole_file, writable_folder
from slip_detector.recordings import write_recording
from slip_detector.recordings.labels import states_at
from slip_detector.sources import Source
from slip_detector.sources.played import SceneSource

NAMESPACE = 'slip_demo'

SPIN_S = 0.05

#: Number of samples that are written at a time.
RECORD_ROWS = 4096


class SlipRecorder(Node):
    """Records all messages of driver and detector with their times of arrival.

    These times come from the middleware of this process. Messages are deserialised only at the
    end, so that the work of this process does not count as latency of the nodes.

    Attributes
    ----------
    stamps_s, rows : list
        Times and volts of the samples.
    position_stamps_s, positions_m : list of float
        Times and positions of the plate.
    latencies_s : list of float
        Time from the stamp of each sample to the receipt of the decision on it.
    """

    def __init__(self, config: DetectorConfig) -> None:
        super().__init__('recorder', namespace=NAMESPACE)
        self.latencies_s: list[float] = []
        # By topic, times of arrival and serialised messages.
        self._received: dict[str, list[tuple[int, bytes]]] = {}
        for topic in ('voltages', 'platform_position', 'slip_detector/envelope'):
            self._keep(JointState, topic, sensor_qos())
        self.topics = ['slip']
        self.topics += [f'slip/group/{name}' for name in config.groups]
        self.topics += [f'slip/channel/{name}' for name in config.names]
        for topic in self.topics:
            self._keep(Bool, topic, state_qos(depth=1000))
        self._own_executor = SampleExecutor([self])

    def receive(self) -> None:
        """Receive the messages that have arrived, if any."""
        self._own_executor.spin_once(timeout_sec=SPIN_S)

    def stop(self) -> None:
        """Stop receiving."""
        self._own_executor.shutdown()

    def receives_all(self) -> bool:
        """Return whether a message of each decision has arrived: the detector is connected."""
        return all(self._received[topic] for topic in self.topics)

    def changes_of(self, topic: str) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the times at which the state of a topic changed, and the new states."""
        received = self._messages(topic, Bool)
        at_s = np.array([at_ns for at_ns, _ in received]) * 1e-9
        states = np.array([message.data for _, message in received], bool)
        changed = np.diff(states, prepend=~states[:1])
        return at_s[changed], states[changed]

    def read(self) -> None:
        """Read all samples, positions and envelopes that were received."""
        samples = self._messages('voltages', JointState)
        self.stamps_s = [stamp_ns(message.header.stamp) * 1e-9 for _, message in samples]
        self.rows = [message.position for _, message in samples]
        positions = self._messages('platform_position', JointState)
        self.position_stamps_s = [
            stamp_ns(message.header.stamp) * 1e-9 for _, message in positions
        ]
        self.positions_m = [message.position[0] for _, message in positions]
        self.latencies_s = [
            (at_ns - stamp_ns(message.header.stamp)) * 1e-9
            for at_ns, message in self._messages('slip_detector/envelope', JointState)
        ]

    def _keep(self, message_type: Any, topic: str, qos: QoSProfile) -> None:
        received = self._received[topic] = []

        def keep(raw: bytes, info: dict[str, int]) -> None:
            received.append((info['received_timestamp'], raw))

        self.create_subscription(
            message_type,
            topic,
            keep,
            qos,
            # Without this, events, which are not needed, wake the executor at each message.
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            raw=True,
        )

    def _messages(self, topic: str, message_type: Any) -> list[tuple[int, Any]]:
        return [
            (at_ns, deserialize_message(raw, message_type)) for at_ns, raw in self._received[topic]
        ]


def play(
    arguments: argparse.Namespace, parameter_file: Path, duration_s: float
) -> tuple[SlipRecorder, DetectorConfig]:
    """Run both nodes on a scene, and record what they publish."""
    config = DetectorConfig.from_yaml(parameter_file)
    rclpy.init()
    recorder = SlipRecorder(config)
    try:
        with NodeProcesses(NAMESPACE, recorder.receive) as nodes:
            nodes.start('slip_detector', '--params-file', str(parameter_file))
            nodes.wait_until(recorder.receives_all, 'the detector to be heard', START_TIMEOUT_S)
            nodes.start(
                'slip_driver',
                *('-p', 'source:=scene'),
                *('-p', 'wait_for_subscribers:=2'),
                *('-p', f'seed:={arguments.seed}'),
                *('-p', f'scene:={arguments.scene}'),
            )
            nodes.wait_for_end('slip_driver', 'the scene to end', START_TIMEOUT_S + duration_s)
    finally:
        recorder.stop()
    recorder.read()
    return recorder, config


def _demo_figures(recorder: SlipRecorder, config: DetectorConfig) -> dict[str, Any]:
    """Compute the paper's figures of merit from the received messages.

    A delay begins at the stamp of the last sample at which the plate still stood (Eq. 9) and ends
    at the receipt of the first ON after it, as a grasp controller would see it. It is None if
    there is no such ON, or nothing moves.
    """
    times_s = np.array(recorder.stamps_s)
    span_s = _motion_span_s(recorder)
    truth, moves = np.zeros(len(times_s), dtype=bool), None
    if span_s:
        moves = {'start_s': span_s[0] - times_s[0], 'end_s': span_s[1] - times_s[0]}
        truth = (times_s >= span_s[0]) & (times_s <= span_s[1])

    def delay_ms(topic: str) -> float | None:
        if not span_s:
            return None
        at_s, states = recorder.changes_of(topic)
        delay_s = first_on_delay_s(states, at_s, span_s[0])
        return None if delay_s is None else delay_s * 1e3

    slip = states_at(*recorder.changes_of('slip'), times_s)
    channels = {name: delay_ms(f'slip/channel/{name}') for name in config.names}
    mean, sd = mean_and_sd(channels.values())
    return {
        'motion': moves,
        'channel_delay_ms': channels,
        'mean_delay_ms': mean,
        'sd_delay_ms': sd,
        'group_delay_ms': {name: delay_ms(f'slip/group/{name}') for name in config.groups},
        'global_delay_ms': delay_ms('slip'),
        'false_positive_percent': percent(
            int(np.count_nonzero(slip & ~truth)), int(np.count_nonzero(~truth))
        ),
        'latency_ms': {
            'median': float(np.median(recorder.latencies_s)) * 1e3,
            'p99': float(np.percentile(recorder.latencies_s, 99)) * 1e3,
        },
    }


def _motion_span_s(recorder: SlipRecorder) -> tuple[float, float] | None:
    """Return when the plate started and stopped (Eq. 9); None if it did not move."""
    if not recorder.latencies_s:
        raise RuntimeError('no decision was received')
    moved = np.flatnonzero(np.diff(recorder.positions_m))
    if not moved.size:
        return None
    stamps_s = recorder.position_stamps_s
    return stamps_s[moved[0]], stamps_s[moved[-1] + 1]


def record_trial(path: str, source: Source, start_ns: int) -> None:
    """Write the samples of a source with their labels; the first one is stamped ``start_ns``."""

    def pieces() -> Iterator[Samples]:
        while len((samples := source.read(RECORD_ROWS)).volts):
            yield samples._replace(stamps_ns=start_ns + samples.stamps_ns)

    write_recording(path, pieces(), source.sample_rate_hz, source.channel_names)


def _to_microseconds(value: Any) -> Any:
    """Round all figures in milliseconds to microseconds, which are accurate enough."""
    if isinstance(value, dict):
        return {name: _to_microseconds(item) for name, item in value.items()}
    return value if value is None else round(float(value), 3)


def _delay_lines(result: dict[str, Any]) -> list[str]:
    def ms(value: float | None) -> str:
        return 'none' if value is None else f'{value:.1f} ms'

    lines = []
    names = list(result['channel_delay_ms'])
    for first in range(0, len(names), 4):
        row = names[first : first + 4]
        lines.append('  ' + '   '.join(
            f'{name:>5} {ms(result["channel_delay_ms"][name]):>9}' for name in row
        ))  # fmt: skip
    mean, sd = ms(result['mean_delay_ms']), ms(result['sd_delay_ms'])
    lines.append(f'  mean over the channels  {mean}, standard deviation {sd}')
    lines.append('  groups  ' + '   '.join(
        f'{name} {ms(delay)}' for name, delay in result['group_delay_ms'].items()
    ))  # fmt: skip
    lines.append(f'  slip    {ms(result["global_delay_ms"])}')
    return lines


def _demo_table(result: dict[str, Any]) -> str:
    """Return the figures as text."""
    lines = ['Delay from the start of the plate to the receipt of the first ON']
    if result['motion'] is None:
        lines[0] += ': undefined, as nothing moves'
    else:
        lines += _delay_lines(result)
    share = result['false_positive_percent']
    at_rest = 'undefined, there is no rest' if share is None else f'{share:.2f} % of the rest'
    lines.append(f'False positives  {at_rest}')
    latency = result['latency_ms']
    lines.append(
        f'Latency from sample to decision received  median {latency["median"]:.2f} ms, '
        f'p99 {latency["p99"]:.2f} ms'
    )
    return '\n'.join(lines)


def main() -> None:
    """Entry point of ``slip_demo``."""
    parser = argparse.ArgumentParser(prog='slip_demo', description=__doc__)
    parser.add_argument('--scene', default='plate_400um', help='name or path of the scene')
    parser.add_argument('--seed', type=int, default=0, help='seed of the scene')
    parser.add_argument(
        '--record',
        metavar='FILE',
        help='write the trial with its labels: .mcap, .db3, .npz, .csv, or a folder that is a bag',
    )
    parser.add_argument('--out', type=Path, default=Path('out'), help='folder for the results')
    arguments = parser.parse_args()
    run_demonstration('slip_demo', lambda: _demonstrate(arguments))


def _demonstrate(arguments: argparse.Namespace) -> None:
    # A wrong argument is reported before anything is started.
    source = SceneSource(DriverConfig(scene=arguments.scene, seed=arguments.seed))
    if arguments.record:
        record_trial(arguments.record, source, time.time_ns())
    writable_folder(arguments.out)
    parameter_file = shared_folder() / 'config' / 'slip_detector.yaml'
    recorder, config = play(arguments, parameter_file, source.duration_s)
    result = _demo_figures(recorder, config)
    with whole_file(arguments.out / 'demo.json') as new:
        new.write_text(json.dumps(_to_microseconds(result), indent=2) + '\n')
    _draw(recorder, config, arguments.out / 'demo.png')
    print(_demo_table(result))
    written = [str(arguments.out / name) for name in ('demo.json', 'demo.png')]
    print(f'Written: {", ".join([*written, *filter(None, [arguments.record])])}')


def _draw(recorder: SlipRecorder, config: DetectorConfig, path: Path) -> None:
    """Draw what was received, in the form of Figs. 5 and 6 of the paper."""
    from slip_detector.report.pictures import draw_trial

    times_s = np.array(recorder.stamps_s)
    span_s = _motion_span_s(recorder)
    draw_trial(
        path,
        times_s - times_s[0],
        np.array(recorder.rows),
        config,
        {
            name: states_at(*recorder.changes_of(f'slip/group/{name}'), times_s)
            for name in config.groups
        },
        states_at(*recorder.changes_of('slip'), times_s),
        (span_s[0] - times_s[0], span_s[1] - times_s[0]) if span_s else None,
    )


if __name__ == '__main__':
    main()
