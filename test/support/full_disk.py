"""A disk that is full: files cannot grow any more."""

import contextlib
import resource


@contextlib.contextmanager
def full_disk(left_bytes):
    """Within a block, let no file of this process grow beyond some bytes.

    The system writes what fits and refuses the rest, as on a disk that fills up.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (left_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
