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


"""Show all fingers on a live page, for any browser."""

import argparse
import asyncio
import contextlib
import secrets
import sys
from pathlib import Path

from rclpy.node import Node
from rclpy.utilities import remove_ros_args

from slip_detector.commands.command_line import Parser, whole_number
from slip_detector.nodes.ending import END_SIGNAL, init_ros
from slip_detector.nodes.launching import REPLAY
from slip_detector.nodes.processes import NodeProcesses
from slip_detector.nodes.view_fingers import RosDetectors
from slip_detector.nodes.view_topics import publish_bag, publish_markers
from slip_detector.parameters import find_parameter_file, shared_folder
from slip_detector.view.access import Access, is_loopback, page_address
from slip_detector.view.parameters import ParameterRequests
from slip_detector.view.server import Server
from slip_detector.view.teaching import Teaching


def serve(executable: str, takedown: contextlib.ExitStack) -> None:
    """Serve the page until a signal arrives.

    A wrong argument is reported as one line on stderr, with the exit code 2.
    """
    arguments = _parser().parse_args(remove_ros_args(sys.argv)[1:])
    _check(arguments)
    asyncio.run(_serve(arguments, takedown))


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog='slip_view', description=__doc__)
    add = parser.add_argument
    add(
        '--host', default='127.0.0.1',
        help='address to listen at (%(default)s, which only this machine can reach); '
        'with 0.0.0.0 all machines can, and the address of the page has a token',
    )  # fmt: skip
    port = whole_number(0, 65535)  # By default not 8765, that of the Foxglove bridge.
    add('--port', type=port, default=8470, help='port; 0: any that is free (%(default)s)')
    add(
        '--token',
        default='',
        help='token of the address (default: a new one; none on this machine)',
    )
    add('--read-only', action='store_true', help='let no page change, record or save anything')
    add(
        '--folder', type=Path, default='slip_recordings',
        help='folder for recordings and saved parameters (%(default)s)',
    )  # fmt: skip
    add(
        '--config', default='',
        help='the parameter file that the detectors were started with, for "as in the file"; '
        'or several, separated by commas, each for the namespace of its name',
    )  # fmt: skip
    played = parser.add_mutually_exclusive_group()
    played.add_argument('--scene', help='play this scene in a loop, its name or path')
    played.add_argument('--bag', type=Path, help='play this recording, to label it by hand')
    text = 'names of the fingers that play it, with commas between (%(default)s)'
    add('--fingers', default='index', help=text)
    return parser


def _check(arguments: argparse.Namespace) -> None:
    """Raise a ValueError for impossible arguments, before anything is started."""
    names = filter(None, arguments.config.split(','))
    arguments.configs = [find_parameter_file(name.strip()) for name in names]
    if arguments.bag and ',' in arguments.fingers:
        raise ValueError(f'--fingers is {arguments.fingers!r}, allowed: one, which plays --bag')
    played = '--scene' if arguments.scene else '--bag' if arguments.bag else ''
    if played and not arguments.configs:
        arguments.configs = [shared_folder() / 'config' / 'slip_detector.yaml']
    if played and len(arguments.configs) > 1:
        raise ValueError(f'{played} is played with one detector a finger, allowed: one --config')


async def _serve(arguments: argparse.Namespace, takedown: contextlib.ExitStack) -> None:
    """Serve the page until a signal arrives, or a node that plays the scene fails."""
    plays = bool(arguments.scene or arguments.bag)
    init_ros(local=plays)
    token = arguments.token or ('' if is_loopback(arguments.host) else secrets.token_urlsafe(16))
    # As the node is not spun, services of its own would leave requests unanswered.
    node = Node('slip_view', start_parameter_services=False)
    takedown.callback(node.destroy_node)
    detectors = RosDetectors(node)
    server = Server(detectors, Access(arguments.host, token, arguments.read_only))
    played_parameters = REPLAY if arguments.bag else {}
    ParameterRequests(server, arguments.folder, arguments.configs, played_parameters)
    Teaching(server, arguments.folder)
    publish_markers(node, server)
    try:
        port = server.listen(arguments.port)
    except (OSError, UnicodeError) as error:
        where = f'--host {arguments.host} --port {arguments.port}'
        why = f'{where} cannot be used ({getattr(error, "strerror", error)})'
        allowed = 'an address of this machine and a port that is free'
        raise ValueError(f'{why}, allowed: {allowed}') from None
    namespace = 'bag' if arguments.bag else 'scene'
    with NodeProcesses(namespace) as nodes, contextlib.closing(detectors):
        if plays:
            (config,) = arguments.configs
            fingers = ('--fingers', arguments.fingers)
            nodes.start('slip_detector', config, *fingers, **played_parameters)
            server.each_tick.append(nodes.check)
        if arguments.bag:
            publish_bag(node, server, arguments.bag, config, f'/bag/{arguments.fingers}')
        elif arguments.scene:
            # A detector that is still starting must not miss samples.
            scene = {'source': 'scene', 'loop': 'true', 'wait_for_subscribers': '1'}
            nodes.start('slip_driver', config, *fingers, scene=arguments.scene, **scene)
        # The messages of the nodes come later: a node takes a second or more to start.
        address = page_address(arguments.host, port, token)
        print(f'slip_view: {address}\nCtrl-C ends it', flush=True)
        await server.run(END_SIGNAL)
