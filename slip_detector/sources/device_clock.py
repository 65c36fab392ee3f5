"""When a sensor's samples were taken, on the receiver's clock."""

from collections.abc import Sequence

#: The smallest delay is looked for in this much of the sender's time, and in as much before it.
WINDOW_NS = 2_000_000_000

#: To follow the estimate, stamps run at most this much faster or slower than the sender's clock:
#: far less than would make a sample look missing.
SLEW = 0.1

#: Being wrong by more is not drift: one of the two clocks was set.
STEP_NS = 250_000_000


class DeviceClock:
    """Maps the times of a sender's clock to the receiver's.

    Bytes wait on their way, now longer, now shorter, but never arrive before they were sent. So
    the sample with the smallest delay says best how the clocks differ; the smallest of the last
    seconds follows their drift. What is left is the shortest way there is, some tenths of a
    millisecond on most lines.
    """

    def __init__(self) -> None:
        self._last_ns: int | None = None
        self._offset_ns = self._newest_ns = self._window_ends_ns = 0
        self._smallest_ns = self._smallest_before_ns = 0
        self.restart()

    def restart(self) -> None:
        """Forget the mapping: the sender's times have nothing to do with those before."""
        self._mapped = False

    def stamps_ns(self, times_ns: Sequence[int], arrival_ns: int) -> list[int]:
        """Stamp consecutive samples that arrived together.

        The stamps rise strictly, except where the receiver's clock itself was set back.

        Parameters
        ----------
        times_ns
            When they were taken by the sender's clock, rising, one or more.
        arrival_ns
            When the last of them arrived by the receiver's clock.
        """
        newest_ns = times_ns[-1]
        delay_ns = arrival_ns - newest_ns
        wanted_ns = self._smallest_delay(newest_ns, delay_ns) - self._offset_ns
        if not self._mapped or abs(wanted_ns) > STEP_NS:
            self._mapped, wanted_ns = True, 0
            self._offset_ns = self._smallest_ns = self._smallest_before_ns = delay_ns
            self._window_ends_ns = newest_ns + WINDOW_NS
        start_ns, offset_ns = self._newest_ns, self._offset_ns
        slope = max(-SLEW, min(SLEW, wanted_ns / max(newest_ns - start_ns, 1)))
        self._newest_ns = newest_ns
        self._offset_ns += round(slope * (newest_ns - start_ns))
        return self.rising([at + offset_ns + round(slope * (at - start_ns)) for at in times_ns])

    def rising(self, stamps_ns: list[int]) -> list[int]:
        """Push stamps that do not rise to just after the one before, if it is close."""
        last_ns = self._last_ns
        for i, at_ns in enumerate(stamps_ns):
            if last_ns is not None and last_ns - STEP_NS <= at_ns <= last_ns:
                stamps_ns[i] = last_ns + 1
            last_ns = stamps_ns[i]
        self._last_ns = last_ns
        return stamps_ns

    def _smallest_delay(self, newest_ns: int, delay_ns: int) -> int:
        if newest_ns >= self._window_ends_ns:
            self._smallest_before_ns, self._smallest_ns = self._smallest_ns, delay_ns
            self._window_ends_ns = newest_ns + WINDOW_NS
        self._smallest_ns = min(self._smallest_ns, delay_ns)
        return min(self._smallest_ns, self._smallest_before_ns)
