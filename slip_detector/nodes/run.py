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

"""Runs nodes in a process that ends silently on signals and with one line on errors."""

import argparse
import functools
import gc
import itertools
import os
import pkgutil
import re
import sys
import time
import traceback
from collections.abc import Callable
from itertools import pairwise
from pathlib import PurePath
from typing import Any, NoReturn

from slip_detector.commands.command_line import one_line
from slip_detector.nodes.ending import ASKED, end_on_signals, init_ros

#: Allowed names of namespaces; the length leaves room for the names of topics.
NAMESPACE = re.compile('(?!.*__)[A-Za-z_][A-Za-z0-9_]{0,63}')

#: Longest time, in seconds, from a launch to a node's refusal; it may have to compile first.
STARTS_S = 120.0

#: Time in seconds after which a node is started again, as in Nav2.
RESPAWN_S = 2.0

#: Variables with the path of a profile, in Fast DDS 2 and 3.
PROFILE_VARIABLES = {'FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE'}

#: Options of ROS that give parameters.
GIVE_PARAMETERS = ('--params-file', '-p', '--param')

#: What the detector of a recording that is played has otherwise than in its file: what it hears is
#: not what the sensor sends, and the times of a recording need not be those of the clock.
PLAYED = {
    'input_type': 'sensor_msgs/msg/JointState',
    'input_field': 'position',
    'max_age_s': 0.0,
}

#: What to do where there is no rclpy.
GET_ROS = "source the setup.bash of a distribution, or pip install 'slip_detector[ros]'"

#: What is called at the end of an executable, in this order.
Takedowns = list[Callable[[], object]]

#: By executable, the class of its nodes, which takes ROS arguments.
NODE_CLASSES = {
    'slip_driver': 'slip_detector.nodes.driver:Driver',
    'slip_detector': 'slip_detector.nodes.detector:Detector',
    'grasp_controller': 'slip_detector.nodes.grasp_controller:GraspController',
}


def main(executable: str) -> None:
    """Spin the nodes of an executable until they end or a signal arrives, and end the process.

    There is one node; with ``--fingers`` one in each of these namespaces; of the detector with
    ``--configs`` one for each parameter file. All run in this process.
    """
    run(executable, functools.partial(_spin, executable))


def run(name: str, work: Callable[[Takedowns], int | None], words: str = '') -> None:
    """Do the work of an executable, and end the process.

    Slow imports belong into the work, also that of :mod:`slip_detector.parameters`: before this
    function is called a signal ends in a traceback.

    Parameters
    ----------
    name
        Name of the executable.
    work
        Adds to a list what is to be called at the end. Returns the exit code, None for 0; after a
        signal that is 0, too. An error is reported as one line on stderr, with exit code 1.
    words
        What is said on stderr when the work was interrupted by a signal.
    """
    end_on_signals()
    takedowns: Takedowns = []
    code = 0
    try:
        from rclpy.executors import ExternalShutdownException

        from slip_detector.nodes.rclpy_internals import ROS_ERRORS, leave
    except ImportError as error:
        sys.exit(f'{name}: needs ROS 2 ({one_line(error)}): {GET_ROS}')
    try:
        code = work(takedowns) or 0
    except ExternalShutdownException:
        if words and ASKED.is_set():
            print(words, file=sys.stderr)
    except (ImportError, ValueError, OSError, *ROS_ERRORS) as error:
        print(f'{name}: {one_line(error)}', file=sys.stderr)
        code = 1
    except Exception:
        traceback.print_exc()
        code = 1
    # A node that is only partly made is not in the takedowns. Its objects refer to each other, and
    # the middleware has it until they are collected.
    leave([*takedowns, gc.collect], code)


def _spin(executable: str, takedowns: Takedowns) -> None:
    """Make and spin the nodes of an executable."""
    from rclpy.executors import SingleThreadedExecutor

    from slip_detector.nodes.parameters import tell_of_other_names
    from slip_detector.nodes.rclpy_internals import LOOK_NS, SampleExecutor, survive_requests

    arguments_of_each = _arguments_of_each(executable)
    node_class = pkgutil.resolve_name(NODE_CLASSES[executable])
    if executable == 'slip_detector':
        from slip_detector.chain.slip_chain import compile_chain

        compile_chain()  # Before the first node, as a signal then ends the process at once.
    init_ros()
    nodes = []
    for arguments in arguments_of_each:
        nodes.append(node_class(arguments))
        takedowns.append(nodes[-1].destroy_node)
        if ASKED.is_set():
            return
    if executable == 'slip_driver':
        from slip_detector.nodes.driver import play_all

        play_all(nodes)
    tell_of_other_names(nodes, executable)
    gc.freeze()  # A collection of what lives until the end would hold up samples.
    # The controller takes few messages; rclpy serves its events, which tell of a detector with
    # an incompatible quality of service.
    grasps = executable == 'grasp_controller'
    executor = SingleThreadedExecutor() if grasps else SampleExecutor()
    for node in nodes:
        survive_requests(node)
        executor.add_node(node)
    takedowns.insert(0, executor.shutdown)
    while not ASKED.is_set():
        executor.spin_once(LOOK_NS * 1e-9)


def declarations(
    arguments: dict[str, tuple[Any, str]], choices: dict[str, list[str]]
) -> list[Any]:
    """Return the declarations of launch arguments: by name, the default value and what it is."""
    from launch.actions import DeclareLaunchArgument

    return [
        DeclareLaunchArgument(
            name, default_value=value, description=text, choices=choices.get(name)
        )
        for name, (value, text) in arguments.items()
    ]


def node_settings(context: Any) -> dict[str, Any]:
    """Return what the launch arguments that all launch files share make of each node.

    A node that is started again by ``use_respawn`` comes after ``RESPAWN_S``.
    """
    given = context.launch_configurations
    return {
        'package': 'slip_detector',
        'namespace': given['namespace'],
        'additional_env': transport_environment(given['transport']),
        'ros_arguments': ['--log-level', given['log_level']],
        'on_exit': ends_launch(),
        'respawn': is_true(context, 'use_respawn'),
        'respawn_delay': RESPAWN_S,
    }


def sim_time(context: Any) -> list[dict[str, bool]]:
    """Return the parameters that the launch argument ``use_sim_time`` adds to each node."""
    # Only true is given: otherwise what the parameter file says holds.
    return [{'use_sim_time': True}] if is_true(context, 'use_sim_time') else []


def source_settings(
    source: str, recording: str, in_file: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, Any], bool]:
    """Return what a launch gives to driver and detector for its source, and whether that ends.

    ``source`` and ``recording`` are launch arguments, empty where the first parameter file, with
    the values ``in_file``, is to decide.
    """
    if recording:
        source = 'recording'
    driver: dict[str, Any] = {'source': source} if source else {}
    # A simulation goes on until it is ended, unless the file says otherwise.
    if source == 'scene' and 'loop' not in in_file:
        driver['loop'] = True
    played = (source or in_file.get('source')) == 'recording'
    in_batches = in_file.get('samples_per_message', 1) != 1
    return driver, PLAYED if played and not in_batches else {}, played


def is_true(context: Any, name: str) -> bool:
    """Return whether a launch argument is true, written as for a condition of launch."""
    return context.launch_configurations[name].lower() in ('true', '1')


def ends_launch() -> Callable[[Any, Any], None]:
    """Return an ``on_exit`` that ends the launch of a node, with code 1, if it refuses to start.

    A node that fails later than ``STARTS_S`` does not end the others: a grasp has to be held.
    After Ctrl-C launch may lose an exit code, and reports another.
    """
    began_s = time.monotonic()

    def on_exit(event: Any, context: Any) -> None:
        starts = time.monotonic() - began_s < STARTS_S and not context.is_shutdown
        if event.returncode > 0 and starts:
            raise RuntimeError(f'{event.process_name} ended with exit code {event.returncode}')

    return on_exit


def transport_environment(transport: str) -> dict[str, str]:
    """Return the environment variables that give a node a transport: ``udp``, or what it has.

    Fast DDS, used over shared memory, can hold up a node for 0.4 s when another one joins.
    """
    from slip_detector.parameters.files import shared_folder

    if not transport:
        return {}
    if own := PROFILE_VARIABLES & os.environ.keys():
        raise ValueError(f'transport is {transport!r}, allowed: none beside {min(own)}')
    here = 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST'
    if here not in os.environ.items() and os.environ.get('ROS_LOCALHOST_ONLY') != '1':
        return {'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}
    # For this range the middleware adds shared memory to any profile; so the profile has it.
    profile = str(shared_folder() / 'config' / 'fastdds_udp_localhost.xml')
    # An empty one counts as not given; any other logs that it is deprecated.
    ranges = {here[0]: 'SYSTEM_DEFAULT', 'ROS_LOCALHOST_ONLY': ''}
    return ranges | dict.fromkeys(PROFILE_VARIABLES, profile)


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise ValueError(f'{message} ({self.prog} --help says more)')


def _options(executable: str) -> argparse.Namespace:
    """Return the options that are not of ROS; an unknown one could mean another node."""
    from rclpy.utilities import remove_ros_args

    parser = _Parser(
        prog=executable,
        usage='%(prog)s [options] [--ros-args ...]',
        allow_abbrev=False,
        epilog=f'Example: {executable} --ros-args --params-file my_sensor.yaml',
    )
    parser.add_argument('--fingers', type=_items, help='names: a node in a namespace of each')
    if executable == 'slip_detector':
        parser.add_argument('--configs', type=_items, help='parameter files: a node for each')
    return parser.parse_args(remove_ros_args(sys.argv)[1:], argparse.Namespace(configs=None))


def _items(text: str) -> list[str]:
    return [item.strip() for item in text.split(',')]


def _arguments_of_each(executable: str) -> list[list[str]]:
    """Return the ROS arguments of each node, from the command line.

    ``--fingers`` gives a node in the namespace of each finger. ``--configs`` gives, below that, a
    node for each parameter file, in a namespace named after the file; all nodes of a finger
    receive the same ``voltages``.

    Each is given again what follows the first parameter file, or all beside ``--configs``, to hold
    over the file: with rcl it does not where something before it is for all nodes.
    """
    from slip_detector.parameters.files import find_parameter_file

    _check_files()
    options = _options(executable)
    fingers, configs = options.fingers, options.configs or []
    # A namespace given for the whole process would be replaced by the others: put it before them.
    whole = [word.partition(':=')[2] for word in sys.argv if word.startswith('__ns:=')]
    hand = whole[-1].strip('/') if whole else ''
    above = ['/' + '/'.join(filter(None, (hand, finger))) for finger in fingers or ['']]
    _check_namespaces('--fingers', fingers or [])
    after = sys.argv if configs else [*itertools.dropwhile('--params-file'.__ne__, sys.argv)][2:]
    again = [word for pair in pairwise(after) if pair[0] in GIVE_PARAMETERS for word in pair]
    names = [PurePath(path).stem for path in configs]
    _check_namespaces('--configs', names)
    of_each = [['-r', f'__ns:={namespace}'] for namespace in above] if fingers else [[]]
    if configs:
        of_each = [
            [
                *('-r', f'__ns:={namespace.rstrip("/")}/{name}'),
                *('-r', f'voltages:={namespace.rstrip("/")}/voltages'),
                *('--params-file', str(find_parameter_file(path))),
            ]
            for namespace in above
            for name, path in zip(names, configs, strict=True)
        ]
    return [['--ros-args', *words, *again] for words in of_each]


def _check_namespaces(option: str, names: list[str]) -> None:
    from slip_detector.parameters.fields import refuse

    if not all(map(NAMESPACE.fullmatch, names)) or len(set(names)) < len(names):
        text = 'different ones of up to 64 letters, digits and single _, no digit first'
        refuse(f'{option} gives the namespaces {", ".join(names)}', text)


def _check_files() -> None:
    """Read the parameters before rcl does, whose error messages are hard to understand."""
    from slip_detector.parameters.files import find_parameter_file, parsed_yaml, read_yaml
    from slip_detector.parameters.sections import check_values, sections_of

    for option, text in pairwise(sys.argv):
        name, assigned, value = text.partition(':=')
        if option in ('-p', '--param') and assigned:
            check_values({name: parsed_yaml(os.fsencode(value), f'{option} {name}')}, option)
        names = _items(text) if option == '--configs' else []
        for path in [text] if option == '--params-file' else map(find_parameter_file, names):
            list(sections_of(read_yaml(path), path))


# The entry points.
driver, detector, grasp_controller = (functools.partial(main, name) for name in NODE_CLASSES)

if __name__ == '__main__':
    main(sys.argv.pop(1))
