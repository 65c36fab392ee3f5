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

"""An independent scorer, written from docs/evaluation.md, row by row and without arrays."""

import itertools
import statistics

import numpy as np


def runs(signal):
    """Return the first row of each run of True, and the row after it."""
    edges = [k for k, (a, b) in enumerate(itertools.pairwise([False, *signal, False])) if a != b]
    return list(zip(edges[::2], edges[1::2], strict=True))


class Stretch:
    """The slips, alarms and rest of the rows between two long gaps."""

    def __init__(self, on, truth, settling_rows, config, rate_hz):
        early, tail, off, late = (
            round(getattr(config, name) * rate_hz)
            for name in ('early_s', 'tail_s', 'off_before_s', 'late_after_s')
        )
        on, n = [bool(one) for one in on], len(on)
        settled = min(max(settling_rows, off), n)
        slips, turned_on = runs(truth), runs(on)
        self.alarms = [
            a for k, (a, _) in enumerate(turned_on) if not k or a - turned_on[k - 1][1] >= off
        ]
        self.of_row = of_row = [self._slips_of(row, slips, early, tail) for row in range(n)]
        self.alarm_of, self.kinds = {}, []
        for row in self.alarms:
            able = of_row[row]
            free = [slip for slip in able if slip not in self.alarm_of]
            begun = any(slips[slip][0] < settled for slip in (free or able)[:1])
            if row < settled:
                self.kinds.append('settling')
                continue
            if free:
                self.alarm_of[free[0]] = row
            kind = 'true' if free else 'repeat' if able else 'false'
            self.kinds.append('settling' if begun else kind)
        scored = [s for s, (start, _) in enumerate(slips) if start >= settled]
        self.slips, self.scored = len(slips), len(scored)
        found = {s: self.alarm_of[s] - slips[s][0] for s in scored if s in self.alarm_of}
        self.latencies_s = [found[s] / rate_hz if s in found else None for s in scored]
        self.late = sum(rows > late for rows in found.values())
        windows = [[row for row in range(settled, n) if s in of_row[row]] for s in scored]
        self.windows_s = [len(rows) / rate_hz for rows in windows]
        # An alarm may begin anywhere within its row.
        self.leads_s = [
            (slips[s][0] - rows[0] + 0.5) / rate_hz
            for s, rows in zip(scored, windows, strict=True)
        ]
        rest = [on[row] for row in range(settled, n) if not of_row[row]]
        self.settling_rows, self.rest_s = settled, len(rest) / rate_hz
        self.on_rest_s = sum(rest) / rate_hz

    @staticmethod
    def _slips_of(row, slips, early, tail):
        """Return the slips to which an alarm in a row can belong, the first of them first."""
        during = [s for s, (start, end) in enumerate(slips) if start <= row < end]
        # Between two slips only these two come into question.
        before = [s for s, (_, end) in enumerate(slips) if end <= row < end + tail][-1:]
        after = [s for s, (start, _) in enumerate(slips) if start - early <= row < start][:1]
        return during or before + after


def figures(stretches):
    """Return the figures of all stretches together, by the names that ``slip_evaluate`` gives."""
    latencies_s, leads_s, windows_s, alarms = (
        [one for stretch in stretches for one in getattr(stretch, name)]
        for name in ('latencies_s', 'leads_s', 'windows_s', 'kinds')
    )
    rest_s, on_s = (
        sum(getattr(one, name) for one in stretches) for name in ('rest_s', 'on_rest_s')
    )
    found_s, false = [one for one in latencies_s if one is not None], alarms.count('false')
    many, detected, scored_s = len(latencies_s), len(found_s), sum(windows_s) + rest_s
    by_chance = sooner = median_all_s = None
    if many and rest_s:
        chances = [min(one * false / rest_s, 1.0) for one in windows_s]
        by_chance = statistics.fmean(chances)
        sooner = statistics.fmean(
            -chance if one is None else 1.0 - 2.0 * min((one + lead) * false / rest_s, 1.0)
            for one, lead, chance in zip(latencies_s, leads_s, chances, strict=True)
        )
        if sooner >= 0.5:
            median_all_s = statistics.median(np.inf if one is None else one for one in latencies_s)
    shown_s = sorted(found_s) if sooner is not None and sooner > 0.0 else []
    in_ms = {
        'latency_median_all_ms': median_all_s,
        'latency_median_ms': statistics.median(shown_s) if shown_s else None,
        'latency_p90_ms': np.percentile(shown_s, 90) if shown_s else None,
        'latency_worst_ms': shown_s[-1] if shown_s else None,
    }
    return {
        'slips': sum(one.slips for one in stretches),
        'settling_slips': sum(one.slips - one.scored for one in stretches),
        'settling_rows': sum(one.settling_rows for one in stretches),
        'matched': detected,
        'missed': many - detected,
        'late': sum(one.late for one in stretches),
        'alarms': len(alarms),
        'repeated_alarms': alarms.count('repeat'),
        'false_alarms': false,
        'settling_alarms': alarms.count('settling'),
        'recall': detected / many if many else None,
        'recall_by_chance': by_chance,
        'sooner_than_chance': sooner,
        'precision': detected / (detected + false) if detected + false else None,
        'precision_by_chance': sum(windows_s) / scored_s if scored_s else None,
        'rest_s': rest_s,
        'false_alarms_per_minute': 60.0 * false / rest_s if rest_s else None,
        'false_time_percent': 100.0 * on_s / rest_s if rest_s else None,
        'false_time_s_per_hour': 3600.0 * on_s / rest_s if rest_s else None,
    } | {name: None if one in (None, np.inf) else 1e3 * one for name, one in in_ms.items()}


def area(scores, positive, negative):
    """Return the share of pairs of rows in which that with slip has the higher score.

    With it comes how far off the area may be, as scores less than 0.1 % apart, and
    those below 1e-38, count as equal.
    """
    a, b = np.meshgrid(scores[positive], scores[negative])
    if not a.size:
        return None, 0.0
    near = (a != b) & np.isclose(a, b, rtol=1e-3, atol=2.0**-126)
    return (a > b).mean() + 0.5 * (a == b).mean(), 0.5 * near.mean() + 1e-9
