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

"""What the launch files share; the functions that a test calls need no launch."""

import functools
import os
import time
from typing import Any

from slip_detector.parameters import shared_folder

#: Longest time, in seconds, from a launch to a node's refusal to start; it may compile before.
STARTS_S = 120.0

#: Time in seconds after which a node that has died is started again, as in Nav2.
RESPAWN_S = 2.0

#: Variables with the path of a profile, in Fast DDS 2 and 3.
PROFILE_VARIABLES = {'FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE'}

#: Parameters that differ from those in the file where the detector hears a recording: the messages
#: are not those of the sensor, and the stamps need not be those of the clock.
REPLAY = {
    'input_type': 'sensor_msgs/msg/JointState',
    'input_field': 'position',
    'max_age_s': 0.0,
}


def declarations(
    arguments: dict[str, tuple[Any, str]], choices: dict[str, list[str]]
) -> list[Any]:
    """Return the declarations of launch arguments: by name, default value and description."""
    from launch.actions import DeclareLaunchArgument

    return [
        DeclareLaunchArgument(
            name, default_value=value, description=text, choices=choices.get(name)
        )
        for name, (value, text) in arguments.items()
    ]


def node_settings(context: Any) -> dict[str, Any]:
    """Return the settings of each node that the launch arguments of all launch files give."""
    values = context.launch_configurations
    return {
        'package': 'slip_detector',
        'namespace': values['namespace'],
        'additional_env': transport_environment(values['transport']),
        'ros_arguments': ['--log-level', values['log_level']],
        'on_exit': functools.partial(end_launch_on_refusal, time.monotonic()),
        'respawn': is_true(context, 'use_respawn'),
        'respawn_delay': RESPAWN_S,
    }


def clock_parameters(context: Any) -> list[dict[str, bool]]:
    """Return the parameters that the launch argument ``use_sim_time`` adds to each node."""
    # Where it is false, the value in the parameter file holds.
    return [{'use_sim_time': True}] if is_true(context, 'use_sim_time') else []


def source_settings(
    source: str, recording: str, in_file: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, Any], bool]:
    """Return the parameters of driver and detector for a source, and whether the source ends.

    ``source`` and ``recording`` are launch arguments. Where both are empty, the values of the
    first parameter file, ``in_file``, decide.
    """
    if recording:
        source = 'recording'
    driver: dict[str, Any] = {'source': source} if source else {}
    # A simulation goes on until it is ended, unless the file says otherwise.
    if source == 'scene' and 'loop' not in in_file:
        driver['loop'] = True
    played = (source or in_file.get('source')) == 'recording'
    in_batches = in_file.get('samples_per_message', 1) != 1
    return driver, REPLAY if played and not in_batches else {}, played


def is_true(context: Any, name: str) -> bool:
    """Return whether a launch argument is true, written as for a condition of launch."""
    return context.launch_configurations[name].lower() in ('true', '1')


def end_launch_on_refusal(began_s: float, event: Any, context: Any) -> None:
    """End the launch, with code 1, if a node has refused to start: an ``on_exit`` of nodes.

    A node that fails later than ``STARTS_S`` does not end the others: a grasp has to be held.
    After Ctrl-C launch may lose an exit code, and reports another.
    """
    starts = time.monotonic() - began_s < STARTS_S and not context.is_shutdown
    if event.returncode > 0 and starts:
        raise RuntimeError(f'{event.process_name} ended with exit code {event.returncode}')


def transport_environment(transport: str) -> dict[str, str]:
    """Return the environment variables of a transport: ``udp``, or empty for no change.

    Fast DDS, used over shared memory, can hold up a node for 0.4 s when another one joins.
    """
    if not transport:
        return {}
    if own := PROFILE_VARIABLES & os.environ.keys():
        raise ValueError(f'transport is {transport!r}, allowed: none beside {min(own)}')
    here = 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST'
    if here not in os.environ.items() and os.environ.get('ROS_LOCALHOST_ONLY') != '1':
        return {'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}
    # For this range the middleware adds shared memory to any profile: the profile has the range.
    profile = str(shared_folder() / 'config' / 'fastdds_udp_localhost.xml')
    # An empty one counts as not given; any other logs that it is deprecated.
    ranges = {here[0]: 'SYSTEM_DEFAULT', 'ROS_LOCALHOST_ONLY': ''}
    return ranges | dict.fromkeys(PROFILE_VARIABLES, profile)
