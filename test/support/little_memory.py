"""A process that gets little more memory than it has."""

import contextlib
import resource
from pathlib import Path


@contextlib.contextmanager
def little_memory(more_bytes):
    """Within a block, refuse this process memory beyond what it has and some bytes more."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path('/proc/self/statm').read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + more_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
