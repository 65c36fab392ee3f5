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

"""Runs the executables: each ends silently on signals, and with one line on errors.

The entry points are here, as Python calls them before anything that takes long to load is loaded.
"""

import contextlib
import functools
import gc
import pkgutil
import sys
import traceback

from slip_detector.commands.command_line import one_line
from slip_detector.nodes.ending import end_on_signals

#: What to do where there is no rclpy.
GET_ROS = "source the setup.bash of a distribution, or pip install 'slip_detector[ros]'"

#: By executable, the function that does its work. It gets the executable's name and a stack, on
#: which it puts what takes its nodes down, and returns the exit code, None for 0.
EXECUTABLES = {
    'slip_driver': 'slip_detector.nodes.spinning:spin',
    'slip_detector': 'slip_detector.nodes.spinning:spin',
    'grasp_controller': 'slip_detector.nodes.spinning:spin',
    'slip_view': 'slip_detector.nodes.view:serve',
    'slip_demo': 'slip_detector.nodes.demo:slip_demo',
    'slip_grasp': 'slip_detector.nodes.demo:slip_grasp',
}


def main(executable: str) -> None:
    """Do the work of an executable until it or a signal ends it, and end the process.

    An error is reported as one line on stderr, with exit code 1; after a signal the code is 0.
    """
    end_on_signals()
    takedown, code = contextlib.ExitStack(), 0
    # A node that is only partly made is not on the stack. Its objects refer to each other, and the
    # middleware keeps the node until they are collected.
    takedown.callback(gc.collect)
    try:
        from rclpy.executors import ExternalShutdownException

        from slip_detector.nodes.rclpy_internals import ROS_ERRORS, shut_down_and_exit
    except ImportError as error:
        sys.exit(f'{executable}: needs ROS 2 ({one_line(error)}): {GET_ROS}')
    try:
        code = pkgutil.resolve_name(EXECUTABLES[executable])(executable, takedown) or 0
    except ExternalShutdownException:
        pass
    except (ImportError, ValueError, OSError, *ROS_ERRORS) as error:
        print(f'{executable}: {one_line(error)}', file=sys.stderr)
        code = 1
    except Exception:
        traceback.print_exc()
        code = 1
    shut_down_and_exit(takedown.close, code)


# The entry points.
driver, detector, grasp_controller, view, demo, grasp = (
    functools.partial(main, executable) for executable in EXECUTABLES
)

if __name__ == '__main__':
    main(sys.argv.pop(1))
