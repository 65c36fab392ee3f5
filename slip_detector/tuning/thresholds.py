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

"""The votes and the thresholds of a chain that are tried."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slip_detector.evaluation.labelled_rows import SLIP
from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.tracks import Track

Floats = NDArray[np.float64]
Vote = str | int

#: Groups up to this size are tried with every k of n, larger ones with these shares of n.
ALL_COUNTS = 6
SHARES = (1 / 8, 1 / 4, 3 / 8, 1 / 2, 5 / 8, 3 / 4, 7 / 8)

#: Ratio of neighbouring thresholds in amplitude (the level to the power of 1 / exponent).
STEP = 1.03

#: Largest ratio, in amplitude, of the highest threshold to the lowest.
RANGE = 1000.0

#: The lowest threshold is found from every n-th row.
STRIDE = 16


def votes_of(config: ChainConfig) -> tuple[Vote, ...]:
    """Return the votes that are tried: ``all``, ``mean`` and k-of-n, the given one among them.

    Examples
    --------
    >>> votes_of(ChainConfig())
    ('all', 'mean', 1, 2, 3)
    """
    disabled = set(config.disabled_channels)
    able = [len(set(members) - disabled) for members in config.groups.values()]
    size = min(many for many in able if many)
    counts = range(1, size) if size <= ALL_COUNTS else [round(share * size) for share in SHARES]
    votes: list[Vote] = ['all', 'mean', *counts]
    return tuple(votes) if config.vote in votes else (*votes, config.vote)


def threshold_scale(chain: ChainConfig) -> tuple[int, float]:
    """Return the power of the amplitude that a chain's level is, and the limit of its thresholds.

    Evidence is no power of the amplitude, as it is in decibels, but it is limited.

    Examples
    --------
    >>> threshold_scale(ChainConfig())
    (3, inf)
    >>> threshold_scale(ChainConfig(decision='evidence', noise_floor=1e-3))
    (1, 1.3)
    """
    if chain.decision == 'evidence':
        return 1, chain.evidence_limit_db_s
    return chain.exponent, math.inf


def thresholds(chain: ChainConfig, statistic: Sequence[Floats], tracks: Sequence[Track]) -> Floats:
    """Return the thresholds of a vote to try, in rising order, evenly spaced in amplitude.

    They range from the median of the rows without slip to the value at which nothing is ON, or to
    the limit of evidence. Thresholds of evidence are at least as far apart as a :data:`STEP` in
    amplitude changes evidence during one window of the envelope. They are rounded before they are
    tried, so that the threshold of a result is one that was tried.

    Parameters
    ----------
    chain
        The chain that has made the statistic; its threshold and vote do not matter.
    statistic
        The decision statistic of each track, shapes (n,).
    tracks
        At least one.

    Returns
    -------
    ndarray
        Empty where the statistic is 0 throughout or infinite anywhere.

    Examples
    --------
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.tuning.tracks import track_of
    >>> rows = LabelledRows(np.zeros((20, 1)), truth=np.zeros(20, bool))
    >>> tracks = [track_of('rest', [rows], sample_rate_hz=100.0)]
    >>> thresholds(ChainConfig(exponent=1), [np.linspace(0.95, 1.0, 20)], tracks)
    array([0.9709, 1.    ])
    """
    top = max((float(part.max()) for part in statistic if part.size), default=0.0)
    if not 0.0 < top < math.inf:
        return np.zeros(0)
    quiet = [
        part[::STRIDE][track.kinds[::STRIDE] != SLIP]
        for part, track in zip(statistic, tracks, strict=True)
    ]
    rest = float(np.median(np.concatenate(quiet))) if any(part.size for part in quiet) else 0.0
    exponent, limit = threshold_scale(chain)
    low = max(rest, top * RANGE**-exponent, 1e-30)
    least_step = 0.0
    if chain.decision == 'evidence':
        least_step = 20.0 * math.log10(STEP) * chain.envelope_window_s
    value, falling = top, [_rounded_up(top)]
    while value > low:
        value = min(value / STEP**exponent, value - least_step)
        if value > 0.0:
            falling.append(rounded(value))
    found = np.array(falling[::-1])
    return found[found < limit]


def rounded(value: float) -> float:
    """Round to four significant digits, which keeps the parameter file readable.

    Examples
    --------
    >>> rounded(0.0123456)
    0.01235
    """
    return float(f'{value:.4g}')


def _rounded_up(value: float) -> float:
    """Round up to four significant digits."""
    near = rounded(value)
    step = 10.0 ** (math.floor(math.log10(value)) - 3)
    return near if near >= value else rounded(near + step)
