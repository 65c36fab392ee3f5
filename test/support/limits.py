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

"""Limits of what this process may take: a disk that is full, and little memory."""

import contextlib
import resource
from pathlib import Path


@contextlib.contextmanager
def limited(what, most_bytes):
    """Within a block, keep a resource of this process below a limit."""
    soft, hard = resource.getrlimit(what)
    resource.setrlimit(what, (most_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(what, (soft, hard))


def full_disk(left_bytes):
    """Within a block, let no file of this process grow beyond some bytes.

    The system writes as much as fits and refuses the rest, as on a full disk.
    """
    return limited(resource.RLIMIT_FSIZE, left_bytes)


def little_memory(more_bytes):
    """Within a block, refuse this process memory beyond what it has and some bytes more."""
    pages = int(Path('/proc/self/statm').read_text().split()[0])
    return limited(resource.RLIMIT_AS, pages * resource.getpagesize() + more_bytes)
