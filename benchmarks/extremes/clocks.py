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

"""Streams of stamps with jitter, losses and a clock that is off: how many rows they become."""

import itertools
from typing import Any

import numpy as np

from slip_detector.chain.samples import Stamps
from slip_detector.chain.stamps import StampGrid

RATE_HZ, MAX_GAP_S = 380.0, 0.1

#: Rows of a stream, and after how many of them the rate changes.
ROWS, CHANGED_AFTER = 8000, 2000

#: Rates, over the configured one, before and after the change.
CLOCKS = [
    *((share, share) for share in (0.85, 0.9, 1.0, 1.1, 1.15)),
    *((1.0, share) for share in (0.85, 0.9, 0.95, 1.05, 1.15)),
]
JITTERS, LOST = (0.0, 0.1, 0.3, 0.4, 0.45), (0.0, 0.01, 0.05)


def stream(clock: tuple[float, float], jitter: float, lost: float, seed: int) -> Stamps:
    """Return the stamps of the samples that are not lost; jitter is in periods, either way."""
    random = np.random.default_rng(seed)
    shares = np.where(np.arange(ROWS) < CHANGED_AFTER, *clock)
    times_s = np.cumsum(1.0 / shares) / RATE_HZ
    times_s += jitter * random.uniform(-1.0, 1.0, ROWS) / shares / RATE_HZ
    kept = random.random(ROWS) >= lost
    kept[[0, -2, -1]] = True
    return 10**18 + np.rint(1e9 * times_s[kept]).astype(np.int64)


def measure_clocks(streams: int) -> list[dict[str, Any]]:
    """Return for each clock, jitter and share of losses how many rows too many are made up."""
    rows = []
    for clock, jitter, lost in itertools.product(CLOCKS, JITTERS, LOST):
        excess = [
            len(StampGrid(1.0 / RATE_HZ, MAX_GAP_S).mend(stream(clock, jitter, lost, seed)).places)
            - ROWS
            for seed in range(streams)
        ]
        row = {
            'clock': ' to '.join(f'{share:g}' for share in dict.fromkeys(clock)),
            'jitter_periods': jitter,
            'lost_share': lost,
            'rows_off_mean': float(np.abs(excess).mean()),
            'rows_off_most': int(max(excess, key=abs)),
        }
        rows.append(row)
    return rows
