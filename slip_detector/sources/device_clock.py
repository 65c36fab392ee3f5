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

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slip_detector.chain.samples import Samples

Stamps = NDArray[np.int64]

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
    array([49000000, 50000000])
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

    def stamps_ns(self, times_ns: ArrayLike, arrival_ns: int) -> Stamps:
        """Stamp consecutive samples that arrived together.

        The stamps rise strictly, except where the receiver's clock itself was set back.

        Parameters
        ----------
        times_ns : array_like of int, shape (n,)
            When the samples were taken, by the sender's clock, in rising order; at least one.
        arrival_ns
            When the last of them arrived, by the receiver's clock.
        """
        times_ns = np.asarray(times_ns, np.int64)
        newest_ns = int(times_ns[-1])
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
        slewed_ns = np.rint(slope * (times_ns - start_ns)).astype(np.int64)
        return self._rising(times_ns + offset_ns + slewed_ns, arrival_ns)

    def stamp(self, decoded: Sequence[Samples], channels: int, arrival_ns: int) -> Samples:
        """Stamp samples by the sender's times, or with their arrival where it sends none.

        Parameters
        ----------
        decoded
            Samples in the order of their arrival, with the sender's times as stamps;
            ``new_stretch`` where its clock was restarted. There may be none.
        channels
            Number of channels.
        arrival_ns
            When the samples arrived, by the receiver's clock.
        """
        stamps_ns = [np.empty(0, np.int64)]
        for samples in decoded:
            if not len(samples.stamps_ns):
                arrived = np.full(len(samples.volts), arrival_ns)
                stamps_ns.append(self._rising(arrived, arrival_ns))
                continue
            if samples.new_stretch:
                self.restart()
            stamps_ns.append(self.stamps_ns(samples.stamps_ns, arrival_ns))
        volts = [np.empty((0, channels)), *(samples.volts for samples in decoded)]
        return Samples(np.concatenate(volts), np.concatenate(stamps_ns))

    def _rising(self, stamps_ns: Stamps, arrival_ns: int) -> Stamps:
        """Move each stamp that is not after the one before to 1 ns after it.

        Where the arrival shows that the receiver's clock was set back, the first stamp may be
        lower than the one before.
        """
        at = np.arange(len(stamps_ns))
        rising_ns = np.maximum.accumulate(stamps_ns - at) + at
        if self._last_ns is not None and arrival_ns >= self._arrival_ns - STEP_NS:
            rising_ns = np.maximum(rising_ns, self._last_ns + 1 + at)
        self._arrival_ns, self._last_ns = arrival_ns, int(rising_ns[-1])
        return rising_ns

    def _smallest_delay(self, newest_ns: int, delay_ns: int) -> int:
        if newest_ns >= self._window_ends_ns:
            self._smallest_before_ns, self._smallest_ns = self._smallest_ns, delay_ns
            self._window_ends_ns = newest_ns + WINDOW_NS
        self._smallest_ns = min(self._smallest_ns, delay_ns)
        return min(self._smallest_ns, self._smallest_before_ns)
