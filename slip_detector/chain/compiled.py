"""Compile with Numba where it is installed; elsewhere the same functions run interpreted."""

import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

try:
    from numba import njit

    COMPILED = True
except ImportError:  # not every robot has Numba
    COMPILED = False


#: Files with any of these have something that is compiled.
MARKS = (b'@compiled', b'@intrinsic')


def _fingerprint() -> str:
    """Return a number that changes with any file that has compiled functions."""
    number = 0
    for path in sorted(Path(__file__).parents[1].rglob('*.py')):
        source = path.read_bytes()
        if any(mark in source for mark in MARKS):
            number = zlib.crc32(source, number)
    return f'{number:08x}'


FINGERPRINT = _fingerprint()


def as_silent(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let a function that runs interpreted overflow as silently as compiled code does."""
    return function if COMPILED else np.errstate(all='ignore')(function)


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile with Numba, cached on disk, where Numba is there.

    Numba takes a function from its cache as long as the function's own file is unchanged, whatever
    became of the functions of other files that are compiled into it. So the cache is named after
    all files that have some: none that is stale is ever found.
    """
    if not COMPILED:
        return function
    function.__qualname__ += f'_{FINGERPRINT}'
    # As NumPy divides: checking each division for a zero costs a tenth of the scenes' time.
    kept: Callable[..., Any] = njit(cache=True, error_model='numpy')(function)
    return kept
