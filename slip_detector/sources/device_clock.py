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

"""Stamps a sensor's samples by the receiver's clock with the time at which they were taken."""

from collections.abc import Iterable, Sequence

import numpy as np

from slip_detector.chain.samples import Samples
from slip_detector.sources.byte_stream import DecodedSamples

#: Length, by the sender's clock, of the windows whose smallest delay is sought. The smaller delay
#: of the present window and the one before is used.
WINDOW_NS = 2_000_000_000

#: Largest share by which stamps run faster or slower than the sender's clock to follow a changed
#: estimate. It is far too small to make a sample look missing.
SLEW = 0.1

#: Largest change of the clocks' difference that can be drift; after a larger one, a clock was set.
STEP_NS = 250_000_000


class DeviceClock:
    """Maps the times of a sender's clock to the receiver's.

    The delay of the bytes varies but is never negative. So the sample with the smallest delay
    gives the best estimate of the difference between the clocks, and the smallest delay of the
    last seconds follows their drift. The remaining error is the shortest delay, which is some
    tenths of a millisecond on most lines.

    Examples
    --------
    >>> clock = DeviceClock()
    >>> clock.stamps_ns([0, 1_000_000], arrival_ns=50_000_000)
    [49000000, 50000000]
    """

    def __init__(self) -> None:
        self._last_ns: int | None = None
        self._arrival_ns = 0
        self._offset_ns = self._newest_ns = self._window_ends_ns = 0
        self._smallest_ns = self._smallest_before_ns = 0
        self.restart()

    def restart(self) -> None:
        """Forget the mapping, as the sender's next times are unrelated to the times before."""
        self._mapped = False

    def stamps_ns(self, times_ns: Sequence[int], arrival_ns: int) -> list[int]:
        """Stamp consecutive samples that arrived together.

        The stamps rise strictly, except where the receiver's clock itself was set back.

        Parameters
        ----------
        times_ns
            When the samples were taken, by the sender's clock, in rising order; at least one.
        arrival_ns
            When the last of them arrived, by the receiver's clock.
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
        stamps_ns = [at + offset_ns + round(slope * (at - start_ns)) for at in times_ns]
        return self.rising(stamps_ns, arrival_ns)

    def stamp(self, decoded: Iterable[DecodedSamples], channels: int, arrival_ns: int) -> Samples:
        """Stamp samples by the sender's times, or with their arrival where it sends none.

        Parameters
        ----------
        decoded
            Samples in the order of their arrival; may be empty.
        channels
            Number of channels.
        arrival_ns
            When the samples arrived, by the receiver's clock.
        """
        stamps_ns: list[int] = []
        volts = [np.empty((0, channels))]
        for samples in decoded:
            if samples.times_ns is None:
                stamps_ns += self.rising([arrival_ns] * len(samples.volts), arrival_ns)
            else:
                if samples.clock_restarted:
                    self.restart()
                stamps_ns += self.stamps_ns(samples.times_ns, arrival_ns)
            volts.append(samples.volts)
        return Samples(np.concatenate(volts), np.array(stamps_ns, dtype=np.int64))

    def rising(self, stamps_ns: list[int], arrival_ns: int) -> list[int]:
        """Move each stamp that is not after the one before to 1 ns after it.

        Where the arrival shows that the receiver's clock was set back, the first stamp may be
        lower than the one before.
        """
        last_ns = self._last_ns if arrival_ns >= self._arrival_ns - STEP_NS else None
        self._arrival_ns = arrival_ns
        for i, at_ns in enumerate(stamps_ns):
            if last_ns is not None and at_ns <= last_ns:
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
