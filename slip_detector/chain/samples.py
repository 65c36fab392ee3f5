"""Samples on their way from a source to the chain."""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray


class Samples(NamedTuple):
    """Consecutive samples, oldest first.

    Attributes
    ----------
    volts : ndarray, shape (n, c)
    truth : ndarray of bool, shape (n,), or None
        Whether there is slip, where the source knows.
    position_m : ndarray, shape (n,), or None
        Position of the platform or the object, where there is one.
    time_s : ndarray, shape (n,), or None
        When each was taken, from the first on; None: one each period of the sample rate.
    """

    volts: NDArray[np.float64]
    truth: NDArray[np.bool_] | None = None
    position_m: NDArray[np.float64] | None = None
    time_s: NDArray[np.float64] | None = None


class Source(Protocol):
    """What the driver plays."""

    sample_rate_hz: float
    channel_names: tuple[str, ...]

    def read(self, n: int) -> Samples:
        """Return the next ``n`` samples; fewer than asked for at the end."""
