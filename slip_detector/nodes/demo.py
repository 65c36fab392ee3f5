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
import functools
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.chain.samples import Floats
from slip_detector.commands.command_line import INTERRUPTED, run
from slip_detector.evaluation.demo import Heard, demo_figures, states_at
from slip_detector.nodes.finger_topics import PolledTopics
from slip_detector.nodes.messages import sensor_qos, stamp_ns, state_qos
from slip_detector.parameters import DetectorConfig, DriverConfig
from slip_detector.parameters.files import shared_folder, whole_file, writable_folder
from slip_detector.recordings import write_recording
from slip_detector.sources.played import SceneSource

NAMESPACE = 'slip_demo'

ENVELOPE = 'slip_detector/envelope'

#: Period, in seconds, at which messages are received.
POLL_S = 0.05

#: Time, in seconds, for which messages are still received after a node has ended.
DRAIN_S = 0.5

#: Timeout of the detector's input: from the end of the driver to its own it does not miss samples.
TIMEOUT_S = 10.0


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
        for process in reversed(self._processes.values()):  # A node before what it listens to.
            process.terminate()
        for process in self._processes.values():
            process.wait()

    def start(self, executable: str, config: Path, *arguments: str, **parameters: object) -> None:
        """Start a node by its executable (see :mod:`slip_detector.nodes.run`)."""
        command = ['setpriv', '--pdeathsig', 'TERM']  # It ends if this process is killed.
        command += [sys.executable, '-m', 'slip_detector.nodes.run', executable, '--ros-args']
        command += ['-r', f'__ns:=/{self._namespace}', '--params-file', str(config)]
        for name, value in parameters.items():
            command += ['-p', f'{name}:={value}']
        self._processes[executable] = subprocess.Popen([*command, '--', *arguments])

    def check(self) -> None:
        """Raise a ValueError if a node has failed."""
        for executable, process in self._processes.items():
            if process.poll():
                raise ValueError(f'{executable} ended with the exit code {process.returncode}')

    def wait_until(self, happened: Callable[[], bool]) -> None:
        """Receive messages until a condition holds; a ValueError if a node fails before.

        The first start compiles the chain, which takes minutes on a small or busy machine. What a
        node waits for is in its log.
        """
        while not happened():
            self.check()
            self._receive()

    def wait_for_end(self, executable: str) -> None:
        """Receive messages until a node has ended without an error, and those still under way."""
        node = self._processes[executable]
        self.wait_until(lambda: node.poll() == 0)
        deadline_s = time.monotonic() + DRAIN_S
        while time.monotonic() < deadline_s:
            self._receive()


def run_demonstration(
    parser: argparse.ArgumentParser,
    demonstrate: Callable[[argparse.Namespace, Path], tuple[dict[str, Any], str]],
) -> None:
    """Run the demonstration of a command, and end the process if it fails.

    It gets the arguments and the path of its picture, and returns its figures, which are written,
    and their table, which is printed. A ValueError or OSError is printed as one line
    on stderr, with exit code 1; after a signal the exit code is 130.
    """
    parser.add_argument('--out', type=Path, default=Path('out'), help='folder for the results')
    arguments = parser.parse_args()
    file = arguments.out / f'{parser.prog.removeprefix("slip_")}.json'
    picture = file.with_suffix('.png')
    # All processes are on this machine.
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    signal.signal(signal.SIGTERM, signal.default_int_handler)

    def work() -> str:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        writable_folder(arguments.out)
        result, table = demonstrate(arguments, picture)
        with whole_file(file) as new:
            new.write_text(json.dumps(result, indent=2) + '\n')
        return f'{table}\nWritten: {file}, {picture}'

    try:
        code = run(parser.prog, work)
    except KeyboardInterrupt:
        code = INTERRUPTED
    finally:
        rclpy.try_shutdown()
    if code:
        sys.exit(code)


class Recorder(PolledTopics):
    """Records all messages of some topics with their times of arrival.

    These times come from the middleware of this process, so that its work does not count as
    latency of the nodes.
    """

    def __init__(self, namespace: str, topics: Mapping[str, tuple[Any, QoSProfile]]) -> None:
        super().__init__(Node('recorder', namespace=namespace))
        #: By topic, the messages and their times of arrival in nanoseconds.
        self.messages: dict[str, list[tuple[int, Any]]] = {topic: [] for topic in topics}
        for topic, (message_type, qos) in topics.items():
            self.add(message_type, topic, qos, functools.partial(self._keep, topic))

    def _keep(self, topic: str, message: Any, info: dict[str, int]) -> None:
        self.messages[topic].append((info['received_timestamp'], message))

    def receive(self) -> None:
        """Wait for a moment, and receive the messages that have arrived."""
        time.sleep(POLL_S)
        self.poll()

    def received_s(self, topic: str) -> Floats:
        """Return when the messages of a topic arrived."""
        return np.array([at_ns for at_ns, _ in self.messages[topic]]) * 1e-9

    def stamps_s(self, topic: str) -> Floats:
        """Return the stamps of the messages of a topic, which have headers or are such."""
        headers = (getattr(message, 'header', message) for _, message in self.messages[topic])
        return np.array([stamp_ns(header.stamp) for header in headers]) * 1e-9

    def values(self, topic: str, field: str) -> NDArray[Any]:
        """Return a field of the messages of a topic."""
        return np.array([getattr(message, field) for _, message in self.messages[topic]])


def _play(arguments: argparse.Namespace, file: Path, config: DetectorConfig) -> Heard:
    """Run both nodes on a scene, and record what they publish."""
    decisions = ['slip', *(f'slip/group/{name}' for name in config.groups)]
    decisions += [f'slip/channel/{name}' for name in config.names]
    topics: dict[str, tuple[Any, QoSProfile]] = {
        topic: (JointState, sensor_qos()) for topic in ('voltages', 'platform_position', ENVELOPE)
    }
    topics |= dict.fromkeys(decisions, (Bool, state_qos(depth=1000)))
    recorder = Recorder(NAMESPACE, topics)
    with NodeProcesses(NAMESPACE, recorder.receive) as nodes:
        nodes.start('slip_detector', file, input_timeout_s=TIMEOUT_S)
        nodes.wait_until(lambda: all(map(recorder.messages.get, decisions)))
        scene = {'scene': arguments.scene, 'seed': arguments.seed, 'loop': 'false'}
        nodes.start('slip_driver', file, source='scene', wait_for_subscribers=2, **scene)
        nodes.wait_for_end('slip_driver')
    begin_s, changes = recorder.stamps_s('voltages')[0], {}
    for topic in decisions:
        states = recorder.values(topic, 'data')
        changed = np.diff(states, prepend=~states[:1])
        changes[topic] = recorder.received_s(topic)[changed] - begin_s, states[changed]
    return Heard(
        recorder.stamps_s('voltages') - begin_s,
        recorder.values('voltages', 'position'),
        recorder.stamps_s('platform_position') - begin_s,
        recorder.values('platform_position', 'position').ravel(),
        recorder.received_s(ENVELOPE) - recorder.stamps_s(ENVELOPE),
        changes,
    )


def main() -> None:
    """Entry point of ``slip_demo``."""
    parser = argparse.ArgumentParser(prog='slip_demo', description=__doc__)
    parser.add_argument('--scene', default='plate_400um', help='name or path of the scene')
    parser.add_argument('--seed', type=int, default=0, help='seed of the scene')
    parser.add_argument(
        '--record', metavar='FILE',
        help='write the trial with its labels: .mcap, .db3, .npz, .csv, or a folder that is a bag',
    )  # fmt: skip
    run_demonstration(parser, _demonstrate)


def _demonstrate(arguments: argparse.Namespace, picture: Path) -> tuple[dict[str, Any], str]:
    from slip_detector.report.pictures import draw_trial
    from slip_detector.report.tables import demo_table

    # A wrong argument is reported before anything is started.
    source = SceneSource(DriverConfig(scene=arguments.scene, seed=arguments.seed))
    if arguments.record:
        samples = source.read(round(source.duration_s * source.sample_rate_hz) + 1)
        samples = samples._replace(stamps_ns=time.time_ns() + samples.stamps_ns)
        write_recording(arguments.record, [samples], source.sample_rate_hz, source.channel_names)
        print(f'Written: {arguments.record}')
    file = shared_folder() / 'config' / 'slip_detector.yaml'
    config = DetectorConfig.from_yaml(file)
    heard = _play(arguments, file, config)
    result = demo_figures(heard, config)
    states = {topic: states_at(*each, heard.stamps_s) for topic, each in heard.changes.items()}
    groups = {name: states[f'slip/group/{name}'] for name in config.groups}
    draw_trial(
        picture, heard.stamps_s, heard.volts, config, groups, states['slip'], heard.motion_s
    )
    return result, demo_table(result)


if __name__ == '__main__':
    main()
