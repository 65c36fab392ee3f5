"""Compile with Numba where it is to be had; the same functions run interpreted where it is not."""

from collections.abc import Callable
from typing import Any

try:
    from numba import njit

    COMPILED = True
except ImportError:  # Numba is not to be had on every robot.
    COMPILED = False


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile with Numba, cached on disk, where Numba is there."""
    return njit(cache=True)(function) if COMPILED else function
