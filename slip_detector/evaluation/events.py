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

"""Slips and alarms at one threshold, as in an evaluation, or at many, as in a search; figures."""

import dataclasses
import functools
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Floats
from slip_detector.evaluation.chance import MEDIAN_IS_DEFINED, recall_by_chance, sooner_than_chance
from slip_detector.recordings.labels import KINDS

#: Times that are measured: of certain slip; of the rest in recordings of no kind and of each kind.
LASTING = ('slip', '', *KINDS)

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
        The lead and the window of each, see :mod:`.chance`.
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
        many, missed = len(self.latencies_ms), np.isnan(self.latencies_ms)
        matched = many - missed.sum(axis=0)
        by_chance = sooner = median_ms = np.full(matched.shape, np.nan)
        if many and self.rest[0].all():
            chance = self.leads_s, self.windows_s, alarms_hz[-1]
            by_chance = recall_by_chance(*chance[1:])
            sooner = sooner_than_chance(self.latencies_ms / 1e3, *chance)
            median_ms = np.median(np.where(missed, np.inf, self.latencies_ms), axis=0)
            median_ms[(sooner < MEDIAN_IS_DEFINED) | np.isinf(median_ms)] = np.nan
        figures = {
            'matched': matched,
            'missed': many - matched,
            'recall': matched / (many or np.nan),
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
