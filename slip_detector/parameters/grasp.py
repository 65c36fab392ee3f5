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

"""The parameters of the grasp controller."""

import re
from typing import Any

from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet

#: Message types of a grip command.
JOINT_STATE, FLOAT64_ARRAY = 'sensor_msgs/msg/JointState', 'std_msgs/msg/Float64MultiArray'

#: Actions of control_msgs that can be the command instead.
ACTIONS = GRIPPER_COMMAND, PARALLEL_COMMAND = 'gripper_command', 'parallel_gripper_command'

#: ROS topic names: relative, private or absolute; the length leaves room for a namespace.
TOPIC_PATTERN = re.compile(r'(?!.{129})(/|~/)?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*')


class GraspConfig(ParameterSet):
    """Parameters of the grasp controller.

    Examples
    --------
    >>> GraspConfig(grip_n=2, limit_n=8).limit_n
    8.0
    >>> GraspConfig(grip_n=9, limit_n=8)
    Traceback (most recent call last):
    ValueError: parameter grip_n is 9 N, allowed: at most limit_n, 8 N
    """

    NODE = 'grasp_controller'

    grip_n: float = parameter(
        1.8, 'Grip force at the start, and the lowest force it relaxes to.', (0.001, 1000.0, 'N')
    )
    limit_n: float = parameter(10.0, 'Largest grip force that is commanded.', (0.001, 1000.0, 'N'))
    step_factor: float = parameter(1.7, 'Slip raises the force by this factor ...', (1.0, 100.0))
    step_n: float = parameter(0.0, '... and by this much more.', (0.0, 1000.0, 'N'))
    repeat_s: float = parameter(
        0.1, 'Shortest time between two increases while slip lasts or returns.', (0.0, 60.0, 's')
    )
    relax_after_s: float = parameter(
        1.0, 'Time from the last slip until the force begins to decrease.', (0.0, 3600.0, 's')
    )
    relax_n_s: float = parameter(0.1, 'Force rate of relaxing; 0: never.', (0.0, 1000.0, 'N/s'))
    closing_n_s: float = parameter(5.0, 'Force rate of closing and opening.', (0.001, 1e6, 'N/s'))
    settle_s: float = parameter(
        0.3, 'For so long after closing slip is ignored: contact looks like it.', (0.0, 60.0, 's')
    )
    on_invalid: str = parameter(
        'hold', 'When slip is invalid or late: hold the force, or open.', choices=('hold', 'open')
    )
    deadline_s: float = parameter(
        1.0, 'Longest silence of slip and slip_valid; at least two heartbeats.', (0.001, 60.0, 's')
    )
    command_hz: float = parameter(
        100.0, 'Rate of repeated commands; a change is commanded at once.', (1.0, 1000.0, 'Hz')
    )
    command_type: str = parameter(
        JOINT_STATE,
        'Message type of the command: with stamp and names, plain numbers for ros2_control, or '
        'the action of a gripper.',
        choices=(JOINT_STATE, FLOAT64_ARRAY, *ACTIONS),
    )
    command_topic: str = parameter(
        'grip_force',
        'Topic of the command, as <controller>/commands, or name of the action, as '
        '<controller>/gripper_cmd.',
    )
    command_joints: tuple[str, ...] = parameter(
        ('grip',), 'Joints that get the command, all the same, in the order of their controller.'
    )
    command_factor: float = parameter(
        1.0, 'Command of a joint per newton; negative if a negative one closes.', (-1e6, 1e6)
    )
    closed_position: float = parameter(
        0.0, "Position of the closed fingers, in an action's goals: m or rad.", (-1e6, 1e6)
    )
    goal_hz: float = parameter(
        10.0, 'Most goals of an action a second; a change waits for the next.', (0.1, 1000.0, 'Hz')
    )

    def __post_init__(self) -> None:
        """Check the fields against each other."""
        super().__post_init__()
        text = f'at most limit_n, {self.limit_n:g} N'
        self.require(self.grip_n <= self.limit_n, 'grip_n', text)
        text, said = 'one of them larger, else slip changes nothing', 'is 1 and step_n is 0'
        self.require(self.step_factor > 1.0 or self.step_n > 0.0, 'step_factor', text, said)
        text = 'names of letters, digits and _ with / between, no digit first, at most 128'
        self.require(bool(TOPIC_PATTERN.fullmatch(self.command_topic)), 'command_topic', text)
        self.require(len(self.command_joints) > 0, 'command_joints', 'at least one name')
        self.require(self.command_factor != 0.0, 'command_factor', 'not 0, else nothing grips')
        if self.command_type in ACTIONS:
            text = 'above 0: the effort of an action has no sign'
            self.require(self.command_factor > 0.0, 'command_factor', text)
            text = 'hold with the action of a gripper, which no lower effort opens'
            self.require(self.on_invalid == 'hold', 'on_invalid', text)


def commands_of_a_scene() -> dict[str, Any]:
    """Return the command parameters that the driver understands when its scene has an object.

    They replace the command parameters of a real gripper, so that the gripper's parameter file
    can be tried on a scene.

    Examples
    --------
    >>> commands_of_a_scene()['command_topic']
    'grip_force'
    """
    values = GraspConfig().to_parameters()
    names = ('command_type', 'command_topic', 'command_joints', 'command_factor')
    return {name: values[name] for name in names}
