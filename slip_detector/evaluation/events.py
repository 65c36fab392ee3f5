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

"""Slips and alarms at one threshold or at many, and their figures.

An evaluation has one threshold, and the tuner tries many at once; both have their figures from
here.
"""

import dataclasses
import functools
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Bools, Floats
from slip_detector.evaluation.chance import HALF, recall_by_chance, sooner_than_chance
from slip_detector.recordings.labels import KINDS

#: The latencies of the slips found, by the share in per cent that is not later.
OF_FOUND = {'latency_median_ms': 50, 'latency_p90_ms': 90, 'latency_worst_ms': 100}


@dataclasses.dataclass(frozen=True, eq=False)
class Events:
    """Slips and rest of recordings, with alarms and time ON at each of T thresholds.

    Attributes
    ----------
    latencies_ms : ndarray, shape (slips, T)
        Latency of each true slip, as far as it is certain; NaN where it is missed and where it is
        not scored.
    scored : ndarray of bool, shape (slips,)
        Whether a slip is scored, see :class:`.ScoredRows`.
    leads_s, windows_s : ndarray, shape (scored slips,)
        The lead and the window of each scored slip, see :mod:`.chance`.
    certain : ndarray, shape (2, T)
        Time that certainly slips, in seconds, and how much of it is ON.
    rests : dict of ndarray, shape (3, T)
        Time of the rest, in seconds, how much of it is ON, and the number of alarms in it, by kind
        of recordings: one of :data:`.labels.KINDS`, '' for those of no kind.

    Examples
    --------
    >>> press = dataclasses.replace(NO_EVENTS, rests={'press': np.array([[30.0], [0.3], [2.0]])})
    >>> slips = Events(np.array([[40.0], [np.nan]]), np.ones(2, bool), np.zeros(2), np.ones(2),
    ...                np.zeros((2, 1)), {'': np.array([[30.0], [0.0], [4.0]])})
    >>> figures = Events.pooled([press, slips]).at()
    >>> figures['recall'], figures['recall_by_chance'], round(figures['sooner_than_chance'], 3)
    (0.5, 0.1, 0.446)
    >>> figures['false_time_percent'], figures['latency_median_ms']
    (0.5, 40.0)
    >>> figures['press_on_percent'], figures['press_alarms_per_minute'], figures['rest_on_percent']
    (1.0, 4.0, None)
    """

    latencies_ms: Floats
    scored: Bools
    leads_s: Floats
    windows_s: Floats
    certain: Floats
    rests: dict[str, Floats]

    @classmethod
    def pooled(cls, parts: Iterable['Events']) -> 'Events':
        """Return those of several recordings, at the same thresholds, together."""
        several = list(parts) or [NO_EVENTS]
        rests: dict[str, Any] = {}
        for one in several:
            for kind, its in one.rests.items():
                rests[kind] = rests.get(kind, 0.0) + its
        names = ('latencies_ms', 'scored', 'leads_s', 'windows_s')
        slips = {name: np.concatenate([getattr(one, name) for one in several]) for name in names}
        certain = np.sum([one.certain for one in several], axis=0)
        return cls(**slips, certain=certain, rests=rests)

    def rest(self, kind: str | None = None) -> Floats:
        """Return the rest of the recordings of a kind, or of all; shape (3, T)."""
        its = [one for of, one in self.rests.items() if kind in (None, of)]
        return sum(its, np.zeros((3, self.certain.shape[1])))

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
        latencies_ms, (rest_s, _, alarms) = self.latencies_ms[self.scored], self.rest()
        missed = np.isnan(latencies_ms)
        many, matched = len(missed), (~missed).sum(axis=0)
        by_chance = sooner = median_ms = np.full(rest_s.shape, np.nan)
        if many and rest_s.all():
            rates_hz = alarms / rest_s
            by_chance = recall_by_chance(self.windows_s, rates_hz)
            sooner = sooner_than_chance(latencies_ms / 1e3, self.leads_s, self.windows_s, rates_hz)
            median_ms = np.median(np.where(missed, np.inf, latencies_ms), axis=0)
            median_ms[(sooner < HALF) | np.isinf(median_ms)] = np.nan
        figures = {
            'matched': matched,
            'missed': many - matched,
            'recall': _per(matched, many),
            'recall_by_chance': by_chance,
            'sooner_than_chance': sooner,
            'coverage': _per(self.certain[1], self.certain[0]),
            'latency_median_all_ms': median_ms,
            **_of_rest(self.rest(), 'false_time_percent', 'false_alarms_per_minute'),
        }
        figures['false_time_s_per_hour'] = 36.0 * figures['false_time_percent']
        for kind in KINDS:
            names = f'{kind}_on_percent', f'{kind}_alarms_per_minute'
            figures |= _of_rest(self.rest(kind), *names)
        return figures

    def at(self, threshold: int = 0) -> dict[str, Any]:
        """Return the figures at one threshold, of which None is not defined.

        To :attr:`figures` are added ``latency_median_ms``, ``latency_p90_ms`` and
        ``latency_worst_ms`` of the slips found, defined where ``sooner_than_chance`` is above 0.
        """
        every = {name: of[threshold] for name, of in self.figures.items()}
        figures = {name: None if np.isnan(one) else one.item() for name, one in every.items()}
        found_ms = self.latencies_ms[self.scored, threshold]
        found_ms = found_ms[~np.isnan(found_ms)]
        defined = found_ms.size and (figures['sooner_than_chance'] or 0.0) > 0.0
        for name, percent in OF_FOUND.items():
            figures[name] = float(np.percentile(found_ms, percent)) if defined else None
        return figures


#: Those of no recording, at one threshold.
NO_EVENTS = Events(
    np.zeros((0, 1)), np.zeros(0, bool), np.zeros(0), np.zeros(0), np.zeros((2, 1)), {}
)


def _of_rest(rest: Floats, on_percent: str, per_minute: str) -> dict[str, NDArray[Any]]:
    """Return the share of the rest that is ON, and the alarms in a minute of it, by names."""
    rest_s, on_s, alarms = rest
    return {on_percent: 100.0 * _per(on_s, rest_s), per_minute: _per(60.0 * alarms, rest_s)}


def _per(part: NDArray[Any], whole: Floats | int) -> Floats:
    """Return a quotient, NaN where the whole is 0."""
    undefined = np.full(part.shape, np.nan)
    return np.asarray(np.divide(part, whole, out=undefined, where=np.asarray(whole) > 0))
