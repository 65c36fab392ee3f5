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

"""Domains of ROS 2 for tests that run side by side."""

import fcntl
import itertools
import os
import tempfile
from pathlib import Path

#: Ports of higher domains may be taken by other connections of the machine.
N_DOMAINS = 100

_next = itertools.count(os.getpid())


def own_domain():
    """Return a domain in which no other test of this machine talks, and the lock that keeps it.

    The lock is a file descriptor; closed, it gives the domain back. Each call begins with another
    domain: nothing left over from a test before can answer.
    """
    for number in itertools.islice(_next, N_DOMAINS):
        domain = number % N_DOMAINS + 1
        path = Path(tempfile.gettempdir()) / f'slip_detector_test_domain_{domain}'
        try:
            lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        except PermissionError:  # Another user's.
            continue
        try:
            # The system takes it off when the process ends, however it ends.
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(lock)
            continue
        return domain, lock
    raise RuntimeError(f'all {N_DOMAINS} domains are taken by other tests')
