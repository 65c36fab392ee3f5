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

"""Makes and spins the nodes of a process, each with arguments of its own."""

import argparse
import contextlib
import functools
import gc
import itertools
import os
import pkgutil
import re
import sys
from itertools import pairwise
from pathlib import PurePath

from rclpy.executors import SingleThreadedExecutor
from rclpy.utilities import remove_ros_args

from slip_detector.commands.command_line import Parser
from slip_detector.nodes.ending import END_SIGNAL, init_ros
from slip_detector.nodes.parameters import tell_of_other_names
from slip_detector.nodes.rclpy_internals import POLL_NS, SampleExecutor, survive_requests
from slip_detector.parameters import (
    check_values,
    find_parameter_file,
    parsed_yaml,
    read_yaml,
    refuse,
    sections_of,
)

#: Allowed names of namespaces; the length leaves room for the names of topics.
NAMESPACE = re.compile('(?!.*__)[A-Za-z_][A-Za-z0-9_]{0,63}')

#: Options of ROS that give parameters.
FILE, *_ = PARAMETER_OPTIONS = ('--params-file', '-p', '--param')

#: By executable, the class of its nodes, which takes ROS arguments.
NODE_CLASSES = {
    'slip_driver': 'slip_detector.nodes.driver:Driver',
    'slip_detector': 'slip_detector.nodes.detector:Detector',
    'grasp_controller': 'slip_detector.nodes.grasp_controller:GraspController',
}


def spin(executable: str, takedown: contextlib.ExitStack) -> None:
    """Make and spin the nodes of an executable until they end or a signal arrives.

    There is one node; with ``--fingers`` one in each of these namespaces; of the detector with
    ``--configs`` one for each parameter file. All run in this process.
    """
    arguments_of_each = _arguments_of_each(executable)
    node_class = pkgutil.resolve_name(NODE_CLASSES[executable])
    if executable == 'slip_detector':
        from slip_detector.chain.slip_chain import compile_chain

        compile_chain()  # Before the first node, as a signal then ends the process at once.
    init_ros()
    nodes = []
    for arguments in arguments_of_each:
        nodes.append(node_class(arguments))
        takedown.callback(nodes[-1].destroy_node)
        if END_SIGNAL.is_set():
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
    takedown.callback(executor.shutdown)
    while not END_SIGNAL.is_set():
        executor.spin_once(POLL_NS * 1e-9)


def _arguments_of_each(executable: str) -> list[list[str]]:
    """Return the ROS arguments of each node, from the command line.

    ``--fingers`` gives a node in the namespace of each finger. ``--configs`` gives, below that, a
    node for each parameter file, in a namespace named after the file; all nodes of a finger
    receive the same ``voltages``.

    The parameters after the first parameter file, or all beside ``--configs``, are given to each
    node once more: rcl lets the section of the file hold over what all nodes are given before it.
    """
    _check_parameters(sys.argv)
    options = _options(executable)
    fingers, configs = options.fingers, options.configs
    names = [PurePath(path).stem for path in configs]
    _check_namespaces('--fingers', fingers)
    _check_namespaces('--configs', names)
    paths = [str(find_parameter_file(path)) for path in configs]
    # A node's namespace replaces that of the process, and so has to contain it.
    of_process = ['', *(word.partition(':=')[2] for word in sys.argv if word.startswith('__ns:='))]
    base = f'/{of_process[-1].strip("/")}'.rstrip('/')
    namespaces = [f'{base}/{finger}' for finger in fingers] or [base]
    arguments = [['-r', f'__ns:={namespace}'] for namespace in namespaces] if fingers else [[]]
    if configs:
        arguments = [
            ['-r', f'__ns:={above}/{name}', '-r', f'voltages:={above}/voltages', FILE, path]
            for above in namespaces
            for name, path in zip(names, paths, strict=True)
        ]
    for words in arguments:
        _check_parameters(words)
    later = sys.argv if configs else [*itertools.dropwhile(FILE.__ne__, sys.argv)][2:]
    repeated = [word for pair in pairwise(later) if pair[0] in PARAMETER_OPTIONS for word in pair]
    return [['--ros-args', *words, *repeated] for words in arguments]


def _options(executable: str) -> argparse.Namespace:
    """Return the options that are not of ROS; an unknown one could mean another node."""
    parser = Parser(
        prog=executable,
        usage='%(prog)s [options] [--ros-args ...]',
        allow_abbrev=False,
        epilog=f'Example: {executable} --ros-args --params-file my_sensor.yaml',
    )
    add = functools.partial(parser.add_argument, type=_items, default=[])
    add('--fingers', help='names, with commas between: each has a node in its namespace')
    parser.set_defaults(configs=[])
    if executable == 'slip_detector':
        add('--configs', help='parameter files, with commas between: each has a node')
    return parser.parse_args(remove_ros_args(sys.argv)[1:])


def _items(text: str) -> list[str]:
    return [item.strip() for item in text.split(',')]


def _check_namespaces(option: str, names: list[str]) -> None:
    if not all(map(NAMESPACE.fullmatch, names)) or len(set(names)) < len(names):
        text = 'different ones of up to 64 letters, digits and single _, no digit first'
        refuse(f'{option} gives the namespaces {", ".join(names)}', text)


def _check_parameters(words: list[str]) -> None:
    """Read the parameters before rcl does, whose error messages are hard to understand."""
    for option, text in pairwise(words):
        name, assigned, value = text.partition(':=')
        if option == FILE:
            list(sections_of(read_yaml(text), text))
        elif option in PARAMETER_OPTIONS and assigned:
            check_values({name: parsed_yaml(os.fsencode(value), f'{option} {name}')}, option)
