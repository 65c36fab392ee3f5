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

"""``slip_demo``: driver and detector as two processes, and what a grasp controller would get.

Also what all demonstrations share: nodes as processes, a recorder of their messages, exit codes.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.chain.samples import Samples
from slip_detector.evaluation.figures import first_on_delay_s, mean_and_sd, percent
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

#: Time, in seconds, that a node is given to end before it is killed.
END_TIMEOUT_S = 10.0

#: Time, in seconds, that nodes are given to start: the first start compiles the chain, which takes
#: minutes on a small or busy machine.
START_TIMEOUT_S = 600.0

#: Time, in seconds, for which messages are still received after a node has ended.
DRAIN_S = 0.5


class NodeProcesses:
    """Runs nodes, each in a process of its own; on leaving the context all of them are ended.

    ``receive`` is called during waits: it receives messages and returns soon.
    """

    def __init__(self, namespace: str, receive: Callable[[], None]) -> None:
        self._namespace, self._receive = namespace, receive
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> 'NodeProcesses':
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes.values():
            if process.poll() is None:
                process.terminate()
        for process in self._processes.values():
            try:
                process.wait(timeout=END_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def start(self, executable: str, *arguments: str) -> None:
        """Start a node by its executable (see :mod:`slip_detector.nodes.run`)."""
        command = [sys.executable, '-m', 'slip_detector.nodes.run', executable, '--ros-args']
        command += ['-r', f'__ns:=/{self._namespace}', *arguments]
        self._processes[executable] = subprocess.Popen(command)

    def check(self) -> None:
        """Raise a RuntimeError if a node has ended."""
        for executable, process in self._processes.items():
            if process.poll() is not None:
                raise RuntimeError(_ended(executable, process.returncode))

    def wait_until(self, happened: Callable[[], bool], what: str, timeout_s: float) -> None:
        """Receive messages until a condition holds; a RuntimeError if a node ends before."""
        deadline_s = time.monotonic() + timeout_s
        while not happened():
            self.check()
            if time.monotonic() > deadline_s:
                raise RuntimeError(f'waited in vain for {what}')
            self._receive()

    def wait_for_end(self, executable: str, what: str, timeout_s: float) -> None:
        """Receive messages until a node has ended without an error, and those still under way."""
        node = self._processes.pop(executable)
        try:
            self.wait_until(lambda: node.poll() is not None, what, timeout_s)
        finally:
            self._processes[executable] = node
        if node.returncode:
            raise RuntimeError(_ended(executable, node.returncode))
        deadline_s = time.monotonic() + DRAIN_S
        while time.monotonic() < deadline_s:
            self._receive()


def _ended(executable: str, code: int) -> str:
    return f'{executable} ended with the exit code {code}'


def run_demonstration(name: str, demonstrate: Callable[[], None]) -> None:
    """Run the demonstration of a command, and end the process if it fails.

    A ValueError, RuntimeError or OSError is printed as one line on stderr, with exit code 1; after
    a signal the exit code is 130.
    """
    # All processes are on this machine.
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    try:
        demonstrate()
    except (KeyboardInterrupt, ExternalShutdownException):
        sys.exit(130)
    except Exception as error:
        context = rclpy.get_default_context()
        if context.handle is not None and not context.ok():
            sys.exit(130)  # The error comes from a signal, which has shut rclpy down.
        if not isinstance(error, ValueError | RuntimeError | OSError):
            raise
        print(f'{name}: {error}', file=sys.stderr)
        sys.exit(1)
    finally:
        rclpy.try_shutdown()


class Recorder(Node):
    """Records all messages of some topics with their times of arrival.

    These times come from the middleware of this process. Messages are deserialised only at the
    end, so that the work of this process does not count as latency of the nodes.
    """

    def __init__(self, namespace: str, topics: Mapping[str, tuple[Any, QoSProfile]]) -> None:
        super().__init__('recorder', namespace=namespace)
        self._types = {topic: message_type for topic, (message_type, _) in topics.items()}
        self._received: dict[str, list[tuple[int, bytes]]] = {topic: [] for topic in topics}
        for topic, (message_type, qos) in topics.items():
            self._keep(message_type, topic, qos)
        self._own_executor = SampleExecutor([self])

    def receive(self) -> None:
        """Receive the messages that have arrived, if any."""
        self._own_executor.spin_once(timeout_sec=SPIN_S)

    def stop(self) -> None:
        """Stop receiving."""
        self._own_executor.shutdown()

    def forget(self) -> None:
        """Forget all messages."""
        for received in self._received.values():
            received.clear()

    def has_heard(self, topics: Iterable[str]) -> bool:
        """Return whether a message of each of the topics has arrived."""
        return all(self._received[topic] for topic in topics)

    def messages(self, topic: str) -> list[tuple[int, Any]]:
        """Return the messages of a topic, with their times of arrival in nanoseconds."""
        message_type = self._types[topic]
        return [
            (at_ns, deserialize_message(raw, message_type)) for at_ns, raw in self._received[topic]
        ]

    def _keep(self, message_type: Any, topic: str, qos: QoSProfile) -> None:
        received = self._received[topic]

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


class Heard(NamedTuple):
    """What a demonstration has heard.

    Times and volts of the samples, times and positions of the plate, the time from the stamp of
    each sample to the receipt of its decision, and for each topic of a decision the times at which
    its state changed, and the new states.
    """

    stamps_s: NDArray[np.float64]
    volts: NDArray[np.float64]
    position_stamps_s: NDArray[np.float64]
    positions_m: NDArray[np.float64]
    latencies_s: NDArray[np.float64]
    changes: Mapping[str, tuple[NDArray[np.float64], NDArray[np.bool_]]]

    @property
    def motion_s(self) -> tuple[float, float] | None:
        """When the plate started and stopped (Eq. 9); None if it did not move."""
        moved = np.flatnonzero(np.diff(self.positions_m))
        if not moved.size:
            return None
        return self.position_stamps_s[moved[0]], self.position_stamps_s[moved[-1] + 1]


def _play(arguments: argparse.Namespace, config_file: Path, duration_s: float) -> Heard:
    """Run both nodes on a scene, and record what they publish."""
    config = DetectorConfig.from_yaml(config_file)
    decisions = ['slip', *(f'slip/group/{name}' for name in config.groups)]
    decisions += [f'slip/channel/{name}' for name in config.names]
    topics: dict[str, tuple[Any, QoSProfile]] = {
        topic: (JointState, sensor_qos())
        for topic in ('voltages', 'platform_position', 'slip_detector/envelope')
    }
    topics |= dict.fromkeys(decisions, (Bool, state_qos(depth=1000)))
    rclpy.init()
    recorder = Recorder(NAMESPACE, topics)
    try:
        with NodeProcesses(NAMESPACE, recorder.receive) as nodes:
            nodes.start('slip_detector', '--params-file', str(config_file))
            nodes.wait_until(
                lambda: recorder.has_heard(decisions), 'the detector to be heard', START_TIMEOUT_S
            )
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
    return _heard(recorder, decisions)


def _heard(recorder: Recorder, decisions: Iterable[str]) -> Heard:
    """Read what a recorder has received."""

    def stamped(topic: str) -> tuple[NDArray[np.float64], NDArray[np.float64], list[Any]]:
        messages = recorder.messages(topic)
        at_s = np.array([at_ns for at_ns, _ in messages]) * 1e-9
        stamps_s = np.array([stamp_ns(message.header.stamp) for _, message in messages]) * 1e-9
        return at_s, stamps_s, [message.position for _, message in messages]

    _, stamps_s, volts = stamped('voltages')
    _, position_stamps_s, positions_m = stamped('platform_position')
    decided_s, decided_stamps_s, _ = stamped('slip_detector/envelope')
    if not len(decided_s):
        raise RuntimeError('no decision was received')
    changes = {}
    for topic in decisions:
        messages = recorder.messages(topic)
        states = np.array([message.data for _, message in messages], bool)
        changed = np.diff(states, prepend=~states[:1])
        at_s = np.array([at_ns for at_ns, _ in messages]) * 1e-9
        changes[topic] = at_s[changed], states[changed]
    return Heard(
        stamps_s, np.array(volts), position_stamps_s, np.array(positions_m).ravel(),
        decided_s - decided_stamps_s, changes,
    )  # fmt: skip


def demo_figures(heard: Heard, config: DetectorConfig) -> dict[str, Any]:
    """Compute the paper's figures of merit from the received messages.

    A delay begins at the stamp of the last sample at which the plate still stood (Eq. 9) and ends
    at the receipt of the first ON after it, as a grasp controller would see it. It is None if
    there is no such ON, or nothing moves.
    """
    times_s, span_s = heard.stamps_s, heard.motion_s
    truth, moves = np.zeros(len(times_s), dtype=bool), None
    if span_s:
        moves = {'start_s': span_s[0] - times_s[0], 'end_s': span_s[1] - times_s[0]}
        truth = (times_s >= span_s[0]) & (times_s <= span_s[1])

    def delay_ms(topic: str) -> float | None:
        if not span_s:
            return None
        at_s, states = heard.changes[topic]
        delay_s = first_on_delay_s(states, at_s, span_s[0])
        return None if delay_s is None else delay_s * 1e3

    slip = states_at(*heard.changes['slip'], times_s)
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
            'median': float(np.median(heard.latencies_s)) * 1e3,
            'p99': float(np.percentile(heard.latencies_s, 99)) * 1e3,
        },
    }


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
    config_file = shared_folder() / 'config' / 'slip_detector.yaml'
    config = DetectorConfig.from_yaml(config_file)
    heard = _play(arguments, config_file, source.duration_s)
    result = demo_figures(heard, config)
    with whole_file(arguments.out / 'demo.json') as new:
        new.write_text(json.dumps(_to_microseconds(result), indent=2) + '\n')
    _draw(heard, config, arguments.out / 'demo.png')
    print(_demo_table(result))
    written = [str(arguments.out / name) for name in ('demo.json', 'demo.png')]
    print(f'Written: {", ".join([*written, *filter(None, [arguments.record])])}')


def _draw(heard: Heard, config: DetectorConfig, path: Path) -> None:
    """Draw what was received, in the form of Figs. 5 and 6 of the paper."""
    from slip_detector.report.pictures import draw_trial

    times_s, span_s = heard.stamps_s, heard.motion_s
    states = {topic: states_at(*changes, times_s) for topic, changes in heard.changes.items()}
    draw_trial(
        path,
        times_s - times_s[0],
        heard.volts,
        config,
        {name: states[f'slip/group/{name}'] for name in config.groups},
        states['slip'],
        (span_s[0] - times_s[0], span_s[1] - times_s[0]) if span_s else None,
    )


if __name__ == '__main__':
    main()
