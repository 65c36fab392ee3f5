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

"""How much better than chance the figures of slips and alarms are.

Alarms that do not depend on slip find slips too: the more alarms, the sooner. How soon follows
from the rest, where each alarm is false: within a time t after any moment, an alarm begins with a
probability of at most t times the rate of false alarms, whether they are random or periodic. All
functions here use this bound as the probability of chance. So no decision that does not depend on
slip is better than chance on average, however often it is ON and however fast it switches.

The *window* of a slip is the length of the time in which its alarm may rise. The *lead* of a slip
is the time from the beginning of the window to the start of the slip, plus half a row, as an alarm
may rise anywhere within a row.
"""

import numpy as np
from numpy.typing import ArrayLike

from slip_detector.chain.samples import Floats

#: Least ``sooner_than_chance`` with which the median latency of all slips is defined.
MEDIAN_IS_DEFINED = 0.5


def recall_by_chance(windows_s: ArrayLike, rates_hz: ArrayLike) -> Floats:
    """Return the largest share of the slips that false alarms alone would find.

    Parameters
    ----------
    windows_s : array_like, shape (slips,)
        The window of each slip; at least one.
    rates_hz : array_like, any shape
        Rates of false alarms in the rest, for example at several thresholds.

    Returns
    -------
    ndarray, of the shape of ``rates_hz``

    Examples
    --------
    >>> recall_by_chance([1.0, 3.0], rates_hz=[0.0, 0.1, 1.0])
    array([0. , 0.2, 1. ])
    """
    rates = np.asarray(rates_hz, np.float64)
    return np.asarray(np.minimum(np.multiply.outer(windows_s, rates), 1.0).mean(axis=0))


def sooner_than_chance(
    latencies_s: ArrayLike, leads_s: ArrayLike, windows_s: ArrayLike, rates_hz: ArrayLike
) -> Floats:
    """Return the share of slips whose alarm beats chance, less the share where chance is sooner.

    The alarm of each slip is compared with the first false alarm that would have come, had the
    slip begun at another time. 1: the alarm is always sooner; 0: as often sooner as later. Where
    neither comes within the window of the slip, neither is sooner.

    Parameters
    ----------
    latencies_s : array_like, shape (slips, ...)
        The latency of each slip, at least one; NaN for a missed slip.
    leads_s, windows_s : array_like, shape (slips,)
        The lead and the window of each slip; see the module's docstring.
    rates_hz : array_like, shape (...)
        Rates of false alarms in the rest.

    Returns
    -------
    ndarray, of the shape of ``rates_hz``

    Examples
    --------
    >>> float(sooner_than_chance([0.05, np.nan], [0.0, 0.0], [1.0, 1.0], rates_hz=0.0))
    0.5
    >>> float(sooner_than_chance([0.25, np.nan], [0.0, 0.0], [1.0, 1.0], rates_hz=1.0))
    -0.25
    """
    rates = np.asarray(rates_hz, np.float64)
    latencies = np.asarray(latencies_s, np.float64)
    leads = np.reshape(leads_s, (-1, *[1] * rates.ndim))
    missed = -np.minimum(np.multiply.outer(windows_s, rates), 1.0)
    found = 1.0 - 2.0 * np.minimum((latencies + leads) * rates, 1.0)
    return np.asarray(np.where(np.isnan(latencies), missed, found).mean(axis=0))


def saved_by_chance_s(
    leads_s: ArrayLike, windows_s: ArrayLike, rates_hz: ArrayLike, most_s: float
) -> Floats:
    """Return how much false alarms alone would lower the mean latency, at most.

    Parameters
    ----------
    leads_s, windows_s : array_like, shape (slips,)
        The lead and the window of each slip, at least one; see the module's docstring.
    rates_hz : array_like, any shape
        Rates of false alarms in the rest.
    most_s
        The latency of a missed slip. Latencies are limited to the range from 0 to this.

    Returns
    -------
    ndarray, of the shape of ``rates_hz``

    Examples
    --------
    >>> saved_by_chance_s([0.0], [2.0], rates_hz=[0.0, 1.0, 1000.0], most_s=0.5)
    array([0.    , 0.125 , 0.4995])
    """
    rates = np.asarray(rates_hz, np.float64)
    each = (-1, *[1] * rates.ndim)
    leads, windows = np.reshape(leads_s, each), np.reshape(windows_s, each)
    highest = np.minimum(windows * rates, 1.0)
    # The probability of an alarm grows with time until it reaches ``highest``.
    full_s = np.minimum(windows, 1.0 / np.maximum(rates, 1e-300))
    grows_s = np.clip(full_s - leads, 0.0, most_s)
    growing = rates * grows_s * (leads + 0.5 * grows_s)
    return np.asarray((growing + highest * (most_s - grows_s)).mean(axis=0))
