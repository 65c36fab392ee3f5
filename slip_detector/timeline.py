"""Stamps of incoming samples: what is next, what is missing, what runs backwards."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

#: A step of more than this many periods is a gap; less is jitter of the stamps.
GAP_PERIODS = 1.5


class Arrival(NamedTuple):
    """What to do with a sample, by its stamp.

    Attributes
    ----------
    accepted : bool
        False: drop it, its stamp is not after the last one.
    missing : int
        Samples missing before it, to be bridged with the last row.
    reset : bool
        Too many are missing, or time has started anew: it is the first of a new stretch.
    """

    accepted: bool
    missing: int
    reset: bool


NEXT = Arrival(True, 0, False)
NEW_STRETCH = Arrival(True, 0, True)
BACKWARDS = Arrival(False, 0, False)


class Timeline:
    """Judges samples by their stamps.

    A stamp that is not after the one before is dropped. When the dropped ones themselves run
    forward for longer than ``max_gap_s``, the clock was set back (or a bag started again) and a
    new stretch begins; else one such step would silence the detector for good.

    Parameters
    ----------
    period_s
        Time from sample to sample.
    max_gap_s
        Longest gap that is bridged.
    """

    def __init__(self, period_s: float, max_gap_s: float) -> None:
        self._period_ns = period_s * 1e9
        self._gap_ns = GAP_PERIODS * self._period_ns
        self._max_gap_ns = max_gap_s * 1e9
        self._last_ns: int | None = None
        self._dropped_first_ns: int | None = None
        self._dropped_last_ns = 0

    def arrive(self, stamp_ns: int) -> Arrival:
        """Judge the next sample by its stamp in nanoseconds."""
        if self._last_ns is None:
            self._last_ns = stamp_ns
            return NEXT
        step_ns = stamp_ns - self._last_ns
        if step_ns <= 0:
            return self._backwards(stamp_ns)
        self._last_ns = stamp_ns
        self._dropped_first_ns = None
        if step_ns < self._gap_ns:
            return NEXT
        if step_ns > self._max_gap_ns:
            return NEW_STRETCH
        return Arrival(True, round(step_ns / self._period_ns) - 1, False)

    def arrive_all(self, stamps_ns: NDArray[np.int64]) -> bool:
        """Take samples all at once if each is simply the next; else take none of them.

        Parameters
        ----------
        stamps_ns : ndarray of int, shape (n,)
            At least one.

        Returns
        -------
        bool
            False: they are to be judged one by one.
        """
        steps_ns = np.diff(stamps_ns)
        last_ns = self._last_ns
        if last_ns is not None and not 0 < int(stamps_ns[0]) - last_ns < self._gap_ns:
            return False
        if not ((steps_ns > 0) & (steps_ns < self._gap_ns)).all():
            return False
        self._last_ns = int(stamps_ns[-1])
        self._dropped_first_ns = None
        return True

    def _backwards(self, stamp_ns: int) -> Arrival:
        if self._dropped_first_ns is None or stamp_ns <= self._dropped_last_ns:
            self._dropped_first_ns = stamp_ns
        self._dropped_last_ns = stamp_ns
        if stamp_ns - self._dropped_first_ns <= self._max_gap_ns:
            return BACKWARDS
        self._last_ns = stamp_ns
        self._dropped_first_ns = None
        return NEW_STRETCH
