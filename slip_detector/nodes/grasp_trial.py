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

"""Plays one grasp through the real nodes, in three processes, and records what they publish."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from slip_detector.nodes.demonstration import START_TIMEOUT_S, NodeProcesses
from slip_detector.nodes.messages import event_qos, sensor_qos, stamp_ns, state_qos
from slip_detector.parameters.grasp import commands_of_a_scene

NAMESPACE = 'slip_grasp'

DRIVER = 'slip_driver'
CONTROLLER = 'grasp_controller'
EXECUTABLES = ('slip_detector', CONTROLLER, DRIVER)

SPIN_S = 0.05

#: Longest time, in seconds, from an onset to a raise of the grip that counts as the answer to it.
ANSWER_S = 0.05

Floats = NDArray[np.float64]


class LiveGraspTrial(NamedTuple):
    """The messages received in one grasp; times are stamps, relative to the first sample.

    Attributes
    ----------
    position : ndarray, shape (n, 2)
        Times, and the distance that the object has slid in metres.
    command : ndarray, shape (m, 2)
        Times, and the commanded grip forces in newtons.
    onset_s : ndarray, shape (k,)
        Times of the samples on which slip came on.

    Examples
    --------
    >>> command, none = np.array([[0.0, 2.0], [1.0, 3.5]]), np.zeros((0, 2))
    >>> LiveGraspTrial(none, command, np.zeros(0)).command_n(np.array([0.5, 1.0])).tolist()
    [2.0, 3.5]
    """

    position: Floats
    command: Floats
    onset_s: Floats

    def command_n(self, time_s: Floats) -> Floats:
        """Return the latest commanded grip force at each time."""
        last = np.searchsorted(self.command[:, 0], time_s, side='right') - 1
        return np.asarray(self.command[np.maximum(last, 0), 1])

    def latencies_s(self) -> list[float]:
        """Return the time from the sample of each onset to the command that answered it.

        An onset during which the last raise still takes effect has no answer and is left out.
        """
        raised_s = self.command[1:, 0][np.diff(self.command[:, 1]) > 0.0]
        answers = [raised_s[raised_s > onset_s][:1] - onset_s for onset_s in self.onset_s]
        return [float(answer[0]) for answer in answers if answer.size and answer[0] < ANSWER_S]


class GraspRecorder(Node):
    """Subscribes to the topics of driver, detector and controller and keeps what arrives."""

    def __init__(self) -> None:
        super().__init__('recorder', namespace=NAMESPACE)
        self._own_executor = SingleThreadedExecutor()
        self._own_executor.add_node(self)
        self.forget()
        self.create_subscription(JointState, 'voltages', self._on_voltages, sensor_qos())
        self.create_subscription(JointState, 'platform_position', self._on_position, sensor_qos())
        self.create_subscription(JointState, 'grip_force', self._on_command, state_qos(depth=1000))
        self.create_subscription(Header, 'slip_onset', self._on_onset, event_qos())

    def receive(self) -> None:
        """Wait briefly for a message and handle it."""
        self._own_executor.spin_once(timeout_sec=SPIN_S)

    def forget(self) -> None:
        """Forget all messages, for a new trial."""
        self._begin_ns: int | None = None
        self._positions: list[tuple[int, float]] = []
        self._commands: list[tuple[int, float]] = []
        self._onsets_ns: list[int] = []

    def trial(self) -> LiveGraspTrial:
        """Return the messages of the trial.

        Raises
        ------
        RuntimeError
            When none were received.
        """
        begin_ns = self._begin_ns
        if begin_ns is None or not self._positions or not self._commands:
            raise RuntimeError('nothing was received of the trial')
        position, command = (
            np.array([[(at_ns - begin_ns) * 1e-9, value] for at_ns, value in noted])
            for noted in (self._positions, self._commands)
        )
        onset_s = np.array([(at_ns - begin_ns) * 1e-9 for at_ns in self._onsets_ns])
        return LiveGraspTrial(position, command, onset_s)

    def _on_voltages(self, message: JointState) -> None:
        if self._begin_ns is None:
            self._begin_ns = stamp_ns(message.header.stamp)

    def _on_position(self, message: JointState) -> None:
        self._positions.append((stamp_ns(message.header.stamp), message.position[0]))

    def _on_command(self, message: JointState) -> None:
        self._commands.append((stamp_ns(message.header.stamp), message.effort[0]))

    def _on_onset(self, message: Header) -> None:
        self._onsets_ns.append(stamp_ns(message.stamp))


def play_grasp(recorder: GraspRecorder, seed: int, config: Path, scene: Path) -> LiveGraspTrial:
    """Play a scene through a driver, a detector and a controller, each a process of its own.

    Raises
    ------
    RuntimeError
        When a node ends before the scene does, or nothing is received.
    """
    words = {'source': 'scene', 'scene': scene, 'seed': seed}
    words |= {'wait_for_subscribers': 2, 'wait_for_grip': 'true'}
    given = {DRIVER: words, CONTROLLER: commands_of_a_scene()}
    recorder.forget()
    with NodeProcesses(NAMESPACE, recorder.receive) as nodes:
        for executable in EXECUTABLES:
            of_this = given.get(executable, {}).items()
            own = [word for name, value in of_this for word in ('-p', f'{name}:={value}')]
            nodes.start(executable, '--params-file', str(config), *own)
        nodes.wait_for_end(DRIVER, 'the scene to end', START_TIMEOUT_S)
    return recorder.trial()
