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

import gc
import os
import re
import signal
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import PurePath
from typing import Any, NoReturn

#: Allowed names of namespaces; the length leaves room for the names of topics.
NAMESPACE = re.compile('(?!.*__)[A-Za-z_][A-Za-z0-9_]{0,63}')

#: Options that are not of ROS; each is followed by a list separated by commas.
OPTIONS = ('--fingers', '--configs')

#: Longest wait, in seconds: on a signal rclpy first wakes all waits and then shuts the context
#: down, so that a wait that begins in between goes on.
LONGEST_WAIT_S = 0.5

EXECUTABLES = ('slip_driver', 'slip_detector', 'grasp_controller')

#: What ``--help`` prints.
USAGE = """usage: {name} [--fingers NAMES]{configs} [--ros-args ...]

  {name} --ros-args --params-file my_sensor.yaml
  {name} --ros-args -p {parameter}
  {name} --fingers thumb,index     # a node for each finger, in a namespace of that name"""

USAGE_OF_CONFIGS = """
  slip_detector --configs onset.yaml,sure.yaml     # a detector for each of these files"""
EXAMPLES = {'slip_driver': 'source:=scene', 'slip_detector': 'threshold:=0.4'}


def run(executable: str) -> int:
    """Spin the nodes of an executable until they end or a signal arrives.

    There is one node; with ``--fingers`` one in each of these namespaces; of the detector with
    ``--configs`` one for each parameter file. All run in this process.

    Slow imports come after the signal handlers are set: otherwise a signal during start-up ends in
    a traceback.

    Returns
    -------
    int
        Exit code: 0, or 1 after an error, which is reported as one line on stderr.
    """
    initialised = compiles = False
    takedowns: list[Callable[[], object]] = []
    code = 0

    def on_signal(*_: Any) -> None:
        # Before rclpy is initialised there is nothing to clean up, and an exception could break
        # an import. Later rclpy's own handler runs before this one and ends the spinning; a node
        # that still compiles would take minutes to reach that point, and has published nothing.
        if not initialised or (compiles and not takedowns):
            os._exit(0)

    def on_compiling() -> None:
        nonlocal compiles
        compiles = True

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    # Objects made during start-up live until the end: the garbage collector need not check them.
    gc.disable()
    import rclpy
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.utilities import remove_ros_args

    from slip_detector.nodes.rclpy_internals import (
        ROS_ERROR,
        SampleExecutor,
        ignore_impossible_times,
        ignore_what_a_signal_leaves,
        mend_parameter_services,
        shut_down,
    )

    ignore_what_a_signal_leaves(lambda: initialised)
    try:
        _check_files(executable, sys.argv)
        ours = remove_ros_args(sys.argv)
        if {'-h', '--help'} & {*ours[1:]}:
            print(usage(executable))
            return 0
        _check_options(ours[1::2])
        make = _maker(executable, on_compiling)
        rclpy.init()
        initialised = True
        nodes = make(_arguments_of_each(sys.argv, ours))
        takedowns = [node.destroy_node for node in nodes]
        for node in nodes:
            ignore_impossible_times(node)
            mend_parameter_services(node)
        gc.freeze()
        gc.enable()
        # The controller takes few messages; rclpy serves its events, which tell of a detector with
        # an incompatible quality of service.
        grasps = executable == 'grasp_controller'
        executor = SingleThreadedExecutor() if grasps else SampleExecutor(nodes)
        for node in nodes:
            executor.add_node(node)
        takedowns.insert(0, executor.shutdown)
        while True:  # Ends with an ExternalShutdownException.
            executor.spin_once(timeout_sec=LONGEST_WAIT_S)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except Exception as error:
        if initialised and not rclpy.ok():
            pass  # A signal has shut the context down during a call, which is a normal end.
        elif (
            isinstance(error, ValueError)
            or not initialised
            # rcl refuses a parameter file, an argument or the name of a node.
            or (not takedowns and isinstance(error, ROS_ERROR))
        ):
            said = str(error) if isinstance(error, ValueError) else ' '.join(str(error).split())
            print(f'{executable}: {said}', file=sys.stderr)
            code = 1
        else:
            code = 1
            raise
    finally:
        # A second signal (ros2 launch sends two) must not interrupt the shutdown.
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
        # A node that is only partly made is not in the takedowns. Its objects refer to each other,
        # and the middleware has it until they are collected.
        shut_down(takedowns or [gc.collect], code)
    return code


def usage(executable: str) -> str:
    """Return how an executable is started, in a few lines."""
    several = executable == 'slip_detector'
    text = USAGE.format(
        name=executable,
        configs=' [--configs FILES]' if several else '',
        parameter=EXAMPLES.get(executable, 'grip_n:=2.0'),
    )
    return text + USAGE_OF_CONFIGS if several else text


def _check_files(executable: str, words: list[str]) -> None:
    """Read the parameter files before rcl does, whose error messages are hard to understand."""
    from slip_detector.parameters.files import read_yaml
    from slip_detector.parameters.sets import our_sections, sections_of

    if '--configs' in words and executable != 'slip_detector':
        raise ValueError('--configs is given, allowed: for slip_detector only')
    for option, path in pairwise(words):
        if option == '--params-file':
            list(sections_of(read_yaml(path), path))
    for path in _items('--configs', words) or []:
        our_sections(path)


def _check_options(options: list[str]) -> None:
    """Refuse unknown options: a typing error would start a node other than the one meant."""
    for option in options:
        if option not in OPTIONS:
            raise ValueError(
                f'{option} is not known, allowed: {", ".join(OPTIONS)}, and --ros-args'
            )
        if options.count(option) > 1:
            raise ValueError(f'{option} is given twice, allowed: once')


def _items(option: str, words: list[str]) -> list[str] | None:
    """Return the list, separated by commas, that follows an option; None without the option."""
    if option not in words:
        return None
    text = ''.join(words[words.index(option) + 1 :][:1])
    items = [item.strip() for item in text.split(',')]
    if not all(items) or len(set(items)) < len(items):
        raise ValueError(f'{option} is {text!r}, allowed: different names with commas between')
    return items


def _arguments_of_each(words: list[str], ours: list[str]) -> list[list[str] | None]:
    """Return the ROS arguments of each node, from the command line with and without those of ROS.

    ``--fingers`` gives a node in the namespace of each finger. ``--configs`` gives, below that, a
    node for each parameter file, in a namespace named after the file; all nodes of a finger
    receive the same ``voltages``.
    """
    fingers, configs = _items('--fingers', ours), _items('--configs', ours)
    if fingers is None and configs is None:
        return [None]
    for finger in fingers or []:
        if not NAMESPACE.fullmatch(finger):
            raise ValueError(
                f'--fingers has {finger!r}, allowed: up to 64 letters, digits and single _, no '
                'digit first, as each is a namespace'
            )
    # A namespace given for the whole process would be replaced by the others: put it before them.
    whole = [word.partition(':=')[2] for word in words if word.startswith('__ns:=')]
    hand = whole[-1].strip('/') if whole else ''
    above = ['/' + '/'.join(filter(None, (hand, finger))) for finger in fingers or ['']]
    if configs is None:
        return [['--ros-args', '-r', f'__ns:={namespace}'] for namespace in above]
    names = [PurePath(path).stem for path in configs]
    if not all(NAMESPACE.fullmatch(name) for name in names) or len(set(names)) < len(names):
        raise ValueError(
            f'--configs is {",".join(configs)!r}, allowed: files with different names, which are '
            'namespaces too: up to 64 letters, digits and single _, no digit first'
        )
    return [
        [
            *('--ros-args', '-r', f'__ns:={namespace.rstrip("/")}/{name}'),
            *('-r', f'voltages:={namespace.rstrip("/")}/voltages', '--params-file', path),
        ]
        for namespace in above
        for name, path in zip(names, configs, strict=True)
    ]


def _maker(executable: str, on_compiling: Callable[[], None]) -> Callable[[list[Any]], list[Any]]:
    """Return the function that creates an executable's nodes from the arguments of each."""
    if executable == 'grasp_controller':
        from slip_detector.nodes.grasp_controller import GraspController

        return lambda of_each: [GraspController(arguments) for arguments in of_each]
    log_compiling(executable, on_compiling)
    if executable == 'slip_driver':
        from slip_detector.nodes.driver import drivers

        return drivers
    from slip_detector.chain.slip_chain import compile_chain
    from slip_detector.nodes.detector import Detector

    compile_chain()  # Before the first node, as a signal then ends the process at once.

    def detector(arguments: list[str] | None) -> Detector:
        try:
            return Detector(arguments)
        except ValueError as error:
            path = arguments[-1] if arguments and '--params-file' in arguments else ''
            # An error in the sections of a file names the file already.
            if not path or str(error).startswith(f'{path}: '):
                raise
            raise ValueError(f'{path}: {error}') from error

    return lambda of_each: [detector(arguments) for arguments in of_each]


def log_compiling(executable: str, begins: Callable[[], None] = lambda: None) -> None:
    """Log when Numba compiles, once for each subpackage, after calling ``begins``."""
    from rclpy.logging import get_logger

    from slip_detector.chain.compiled import on_compiling

    logged: set[str] = set()

    def log(module: str) -> None:
        begins()
        gc.enable()  # Compiling leaves garbage to collect.
        subpackage = module.rpartition('.')[0]
        if subpackage not in logged:
            logged.add(subpackage)
            get_logger(executable).info(
                f'compiling {subpackage}, which takes some seconds and is kept for the next start '
                '(slip_compile does it beforehand)'
            )

    on_compiling(log)


def main(executable: str) -> NoReturn:
    """Run an executable and leave with its exit code."""
    code = run(executable)
    from slip_detector.nodes.rclpy_internals import leave

    leave(code)


def driver() -> None:
    """Entry point of ``slip_driver``."""
    main('slip_driver')


def detector() -> None:
    """Entry point of ``slip_detector``."""
    main('slip_detector')


def grasp_controller() -> None:
    """Entry point of ``grasp_controller``."""
    main('grasp_controller')


if __name__ == '__main__':
    if len(sys.argv) < 2 or sys.argv[1] not in EXECUTABLES:
        sys.exit(f'the first word says what to run, allowed: {", ".join(EXECUTABLES)}')
    main(sys.argv.pop(1))
