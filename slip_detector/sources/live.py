"""Sensors that send while the driver listens: what serial and UDP have in common."""

from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from slip_detector.sources.device_clock import DeviceClock
from slip_detector.sources.packets import Received

#: The longest time that a read waits for something to come.
WAIT_S = 0.1


class LiveSamples(NamedTuple):
    """Consecutive samples, oldest first.

    Attributes
    ----------
    stamps_ns : list of int, length n
        When each was taken, on the node's clock.
    volts : ndarray, shape (n, c)
    """

    stamps_ns: list[int]
    volts: NDArray[np.float64]


class LiveSource(Protocol):
    """What the driver listens to.

    Attributes
    ----------
    counts : Counter of str
        What came and what was dropped, as the decoders of ``packets.py`` count it.
    state : str
        What it listens to, or why it cannot.
    connected : bool
        Whether it can.
    """

    counts: Counter[str]
    state: str
    connected: bool

    def read(self) -> list[LiveSamples]:
        """Wait at most ``WAIT_S`` for samples and return what came, perhaps nothing."""

    def close(self) -> None:
        """Let go of what it listens to."""


def stamped(
    received: Iterable[Received], clock: DeviceClock, arrival_ns: int
) -> list[LiveSamples]:
    """Give samples their times: those of the sender's clock, else that of their arrival."""
    samples = []
    for volts, times_ns, clock_restarted in received:
        if times_ns is None:
            stamps_ns = clock.rising([arrival_ns] * len(volts))
        else:
            if clock_restarted:
                clock.restart()
            stamps_ns = clock.stamps_ns(times_ns, arrival_ns)
        samples.append(LiveSamples(stamps_ns, volts))
    return samples
