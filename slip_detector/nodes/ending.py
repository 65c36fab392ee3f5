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

"""Ends a process on SIGINT and SIGTERM, whatever it does then and however many of them come."""

import os
import signal
import threading
import time

#: Longest time, in seconds, from the first signal, or from the beginning of the shutdown, to the
#: end of the process. A shutdown normally takes some hundredths of a second. Other processes see
#: a node that has ended without it for some twenty seconds more.
SHUTDOWN_S = 2.0

#: Set by the first signal: the nodes are to be taken down, and the process is to end.
END_SIGNAL = threading.Event()

# Set when nodes may exist. Until then a signal ends the process at once.
_nodes_exist = threading.Event()


def end_on_signals() -> None:
    """Let SIGINT and SIGTERM end the process with exit code 0, within ``SHUTDOWN_S``.

    Python calls a handler between any two steps of the main thread: an exception of the handler
    may fall into a call of the middleware, into an import, or into the shutdown. So the handlers
    here do nothing; Python also writes signals to a pipe, which a thread reads.
    """
    reads, writes = os.pipe()
    os.set_blocking(writes, False)
    signal.set_wakeup_fd(writes, warn_on_full_buffer=False)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: None)
    threading.Thread(target=_end, args=[reads], daemon=True).start()


def _end(reads: int) -> None:
    os.read(reads, 1)
    if _nodes_exist.is_set():
        END_SIGNAL.set()
        time.sleep(SHUTDOWN_S)
    os._exit(0)


def init_ros(local: bool = False) -> None:
    """Initialise rclpy; from here on a signal sets ``END_SIGNAL``, and nodes are taken down.

    Where the nodes are ``local``, this process and those that it starts talk on this machine only,
    unless the environment says otherwise.
    """
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    if local:
        os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    # rclpy's own handlers would shut the middleware down in the middle of a call.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    _nodes_exist.set()
