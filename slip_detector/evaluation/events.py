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

"""Slips and alarms at one threshold, as in an evaluation, or at many, as in a search; figures.

Alarms that do not depend on slip find slips too: the more alarms, the sooner. How soon follows
from the rest, where each alarm is false: within a time t after any moment, an alarm begins with a
probability of at most t times the rate of false alarms, whether they are random or periodic. The
functions here use this bound as the probability of chance. So no decision that does not depend on
slip is better than chance on average, however often it is ON and however fast it switches.

The *window* of a slip is the length of the time in which its alarm may rise. The *lead* of a slip
is the time from the beginning of the window to the start of the slip, plus half a row, as an alarm
may rise anywhere within a row.
"""

import dataclasses
import functools
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slip_detector.chain.samples import Floats
from slip_detector.recordings.labels import KINDS

#: Times that are measured: of certain slip; of the rest in recordings of no kind and of each kind.
LASTING = ('slip', '', *KINDS)

#: Least ``sooner_than_chance`` with which the median latency of all slips is defined.
MEDIAN_IS_DEFINED = 0.5

#: Percentiles of the latencies of the slips found.
PERCENTILES = {'latency_median_ms': 50, 'latency_p90_ms': 90, 'latency_worst_ms': 100}


@dataclasses.dataclass(frozen=True, eq=False)
class Events:
    """Scored slips and rest, with alarms and time ON at each of T thresholds.

    Attributes
    ----------
    latencies_ms : ndarray, shape (slips, T)
        Latency of each scored slip, as far as it is certain; NaN where it is missed.
    leads_s, windows_s : ndarray, shape (slips,)
        The lead and the window of each, see above.
    lasting : ndarray, shape (7, 3, T)
        For each of :data:`LASTING` the time, how much of it is ON, in seconds, and the number of
        false alarms.
    settling : int
        Number of slips that are not scored, as they begin while the chain settles.
    """

    latencies_ms: Floats
    leads_s: Floats
    windows_s: Floats
    lasting: Floats
    settling: int = 0

    @classmethod
    def pooled(cls, parts: Iterable['Events']) -> 'Events':
        """Return the events of several recordings, at the same thresholds, together."""
        several = list(parts) or [NO_EVENTS]
        slips = zip(*((p.latencies_ms, p.leads_s, p.windows_s) for p in several), strict=True)
        latencies_ms, leads_s, windows_s = map(np.concatenate, slips)
        lasting = np.sum([part.lasting for part in several], axis=0)
        settling = sum(part.settling for part in several)
        return cls(latencies_ms, leads_s, windows_s, lasting, settling)

    def at_one(self, threshold: int) -> 'Events':
        """Return the events at one threshold."""
        lasting, latencies_ms = self.lasting[..., [threshold]], self.latencies_ms[:, [threshold]]
        return dataclasses.replace(self, latencies_ms=latencies_ms, lasting=lasting)

    @property
    def rest(self) -> Floats:
        """Time of all rest, how much of it is ON, and the alarms in it; shape (3, T)."""
        return np.asarray(self.lasting[1:].sum(axis=0))

    @functools.cached_property
    def figures(self) -> dict[str, NDArray[Any]]:
        """The figures at each threshold, by name; NaN where one is not defined.

        How many slips are ``matched`` to an alarm, and ``missed``; ``recall``: the share of the
        slips that are found; :func:`.recall_by_chance` and :func:`.sooner_than_chance`;
        ``coverage``: the share of the time that certainly slips in which the decision is ON;
        ``false_alarms_per_minute`` of rest; ``false_time_percent``: the share of the rest that is
        ON, and ``false_time_s_per_hour``, the same in another unit; ``latency_median_all_ms``: of
        all slips with missed ones as the latest, defined where ``sooner_than_chance`` is at least
        0.5; and ``<kind>_on_percent`` and ``<kind>_alarms_per_minute`` for each kind.
        """
        with np.errstate(invalid='ignore'):  # Of no time, 0 / 0 is not defined.
            lasting = np.concatenate([self.lasting, self.rest[np.newaxis]])
            on, alarms_hz = np.swapaxes(lasting[:, 1:] / lasting[:, :1], 0, 1)
        scored, missed = len(self.latencies_ms), np.isnan(self.latencies_ms)
        matched = scored - missed.sum(axis=0)
        by_chance = sooner = median_ms = np.full(matched.shape, np.nan)
        if scored and self.rest[0].all():
            chance = self.leads_s, self.windows_s, alarms_hz[-1]
            by_chance = recall_by_chance(*chance[1:])
            sooner = sooner_than_chance(self.latencies_ms / 1e3, *chance)
            median_ms = np.median(np.where(missed, np.inf, self.latencies_ms), axis=0)
            median_ms[(sooner < MEDIAN_IS_DEFINED) | np.isinf(median_ms)] = np.nan
        figures = {
            'matched': matched,
            'missed': scored - matched,
            'recall': matched / (scored or np.nan),
            'recall_by_chance': by_chance,
            'sooner_than_chance': sooner,
            'coverage': on[0],
            'false_alarms_per_minute': 60.0 * alarms_hz[-1],
            'false_time_percent': 100.0 * on[-1],
            'false_time_s_per_hour': 3600.0 * on[-1],
            'latency_median_all_ms': median_ms,
        }
        for number, kind in enumerate(KINDS, LASTING.index(KINDS[0])):
            figures[f'{kind}_on_percent'] = 100.0 * on[number]
            figures[f'{kind}_alarms_per_minute'] = 60.0 * alarms_hz[number]
        return figures

    def at(self, threshold: int = 0) -> dict[str, Any]:
        """Return the figures at one threshold, None where one is not defined.

        To :attr:`figures` are added ``latency_median_ms``, ``latency_p90_ms`` and
        ``latency_worst_ms`` of the slips found, defined where ``sooner_than_chance`` is above 0.
        """
        # NumPy rounds the mean of one column in another way than that of several.
        alone = self.at_one(threshold)
        found_ms = alone.latencies_ms[~np.isnan(alone.latencies_ms)]
        every = {name: value.item() for name, value in alone.figures.items()}
        figures = {name: None if np.isnan(value) else value for name, value in every.items()}
        defined = found_ms.size and (figures['sooner_than_chance'] or 0.0) > 0.0
        for name, percent in PERCENTILES.items():
            figures[name] = float(np.percentile(found_ms, percent)) if defined else None
        return figures


#: The events of no recording, at one threshold.
NO_EVENTS = Events(np.zeros((0, 1)), np.zeros(0), np.zeros(0), np.zeros((len(LASTING), 3, 1)))


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
    column = (-1, *[1] * rates.ndim)
    leads, windows = np.reshape(leads_s, column), np.reshape(windows_s, column)
    highest = np.minimum(windows * rates, 1.0)
    # The probability of an alarm grows with time until it reaches ``highest``.
    full_s = np.minimum(windows, 1.0 / np.maximum(rates, 1e-300))
    grows_s = np.clip(full_s - leads, 0.0, most_s)
    growing = rates * grows_s * (leads + 0.5 * grows_s)
    return np.asarray((growing + highest * (most_s - grows_s)).mean(axis=0))
