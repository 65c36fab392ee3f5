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

"""Detects that the input has fallen silent."""

#: Number of checks within ``input_timeout_s``, and the share of the timeout after which the input
#: counts as lost, from the last check that found a sample. That is between 0.8 and 0.9 of the
#: timeout after the last sample.
LOOKS, GIVEN_UP_AFTER = 10, 0.75


class SilenceWatch:
    """Detects that samples have stopped arriving.

    The receiver of samples sets ``heard``, and a timer calls :meth:`is_lost` ``LOOKS`` times
    within the timeout: so the clock is not read for each sample. If the clock is set back, the
    timeout begins again.

    Parameters
    ----------
    now_ns
        The time, by the clock that the timeout follows.

    Attributes
    ----------
    heard : bool
        Whether a sample has arrived since the last check.

    Examples
    --------
    >>> watch = SilenceWatch(now_ns=0)
    >>> watch.heard = True
    >>> [watch.is_lost(now_ns, timeout_s=1.0) for now_ns in (10**8, 8 * 10**8, 9 * 10**8, 10**9)]
    [False, False, True, False]
    """

    def __init__(self, now_ns: int) -> None:
        self.heard = False
        # Time of the last check that found a sample, and whether the loss has been reported.
        self._heard_ns, self._told = now_ns, False

    def is_lost(self, now_ns: int, timeout_s: float) -> bool:
        """Return whether the input is lost; True only once, until samples arrive again.

        Parameters
        ----------
        now_ns
            The time, by the clock that the timeout follows.
        timeout_s
            The timeout.
        """
        if self.heard or now_ns < self._heard_ns:
            self.heard, self._heard_ns, self._told = False, now_ns, False
            return False
        if self._told or (now_ns - self._heard_ns) * 1e-9 < GIVEN_UP_AFTER * timeout_s:
            return False
        self._told = True
        return True
