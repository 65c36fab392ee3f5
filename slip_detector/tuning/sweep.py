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

"""The figures of all thresholds and votes of a chain from one pass over labelled rows.

For each vote the chain gives one number for each row, the decision statistic, which is compared
with the threshold. The global decision rises where this number rises above the threshold. So the
filters run once, and a row takes time only for the thresholds that the number crosses.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slip_detector.chain.samples import Floats
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.events import Events
from slip_detector.evaluation.matching import ScoredRows
from slip_detector.evaluation.scores import SLIP, UNCERTAIN, ScoreCounts, ScoreTally
from slip_detector.parameters import ChainConfig, EvaluationConfig
from slip_detector.tuning.tracks import Track

Vote = str | int

#: Number of rows that the chain is given at a time, so that its results stay in the cache.
ROWS_PER_CALL = 2048

#: Groups up to this size are tried with every k of n, larger ones with these shares of n.
ALL_COUNTS = 6
SHARES = (1 / 8, 1 / 4, 3 / 8, 1 / 2, 5 / 8, 3 / 4, 7 / 8)

#: In groups of at least this many channels one channel alone, which may drift, does not decide,
#: unless that is the given vote.
LEAST_AGREEING = 4

#: Ratio of neighbouring thresholds in amplitude (the level to the power of 1 / exponent).
STEP = 1.03

#: Largest ratio, in amplitude, of the highest threshold to the lowest.
RANGE = 1000.0

#: The lowest threshold is found from every n-th row.
STRIDE = 16

# Its table is large, so it is made once. It is empty between calls.
_TALLY = ScoreTally()


def votes_of(config: ChainConfig) -> tuple[Vote, ...]:
    """Return the votes that are tried: ``all``, ``mean`` and k-of-n, the given one among them.

    Examples
    --------
    >>> votes_of(ChainConfig())
    ('all', 'mean', 2, 3)
    """
    disabled = set(config.disabled_channels)
    sizes = [len(set(members) - disabled) for members in config.groups.values()]
    size = min(filter(None, sizes))
    counts = range(1, size) if size <= ALL_COUNTS else [round(share * size) for share in SHARES]
    least = 2 if size >= LEAST_AGREEING else 1
    votes: tuple[Vote, ...] = ('all', 'mean', *(k for k in counts if k >= least))
    return votes if config.vote in votes else (*votes, config.vote)


class VoteStatistics(NamedTuple):
    """The decision statistic of one vote over labelled recordings, and its figures.

    Attributes
    ----------
    chain : ChainConfig
        The chain with this vote.
    parts : sequence of (ndarray, Track, ScoredRows)
        For each recording the statistic in the unit of the level, shape (n,); the chain is ON
        exactly where it is above the threshold.
    """

    chain: ChainConfig
    parts: Sequence[tuple[Floats, Track, ScoredRows]]

    def thresholds(self) -> Floats:
        """Return the thresholds to try in rising order, evenly spaced in amplitude.

        They range from the median of the rows without slip to the value at which nothing is ON, or
        to the limit of evidence. Thresholds of evidence are at least as far apart as a
        :data:`STEP` in amplitude changes evidence during one window of the envelope. All are
        rounded before they are tried, so that the threshold of a result is one that was tried.
        There is none where the statistic is 0 throughout or infinite anywhere. The threshold of
        the chain does not matter.
        """
        top = max(float(values.max()) for values, *_ in self.parts)
        if not 0.0 < top < math.inf:
            return np.zeros(0)
        sparse = slice(None, None, STRIDE)
        quiet = [
            values[sparse][track.row_classes[sparse] < SLIP] for values, track, _ in self.parts
        ]
        rest = float(np.median(np.concatenate(quiet))) if any(map(len, quiet)) else 0.0
        exponent, least_step, limit = self.chain.exponent, 0.0, math.inf
        if (
            self.chain.decision == 'evidence'
        ):  # in decibels, so no power of the amplitude, and limited
            exponent, limit = 1, self.chain.evidence_limit_db_s
            least_step = 20.0 * math.log10(STEP) * self.chain.envelope_window_s
        low = max(rest, top * RANGE**-exponent, 1e-30)
        value, falling = top, [round_digits(top)]
        if falling[0] < top:
            falling[0] = round_digits(falling[0] + 10.0 ** (math.floor(math.log10(top)) - 3))
        while value > low:
            value = min(value / STEP**exponent, value - least_step)
            if value > 0.0:
                falling.append(round_digits(value))
        rising = np.array(falling[::-1])
        return rising[rising < limit]

    def events(self, limits: Floats) -> list[Events]:
        """Return the events of each recording at each of these thresholds, which rise."""
        return [
            rows.match(np.arange(values.size), values, limits)[1] for values, _, rows in self.parts
        ]

    def count_scores(self, threshold: float) -> ScoreCounts:
        """Count the scores by class, as an evaluation with this threshold does."""
        for values, track, rows in self.parts:
            classes = track.row_classes.copy()
            for (begin, _), settled in zip(track.stretches, rows.settled, strict=True):
                classes[begin:settled] = UNCERTAIN
            # The chain divides in the same way, so the scores equal an evaluation's to the bit.
            _TALLY.add(values / threshold, classes)
        return _TALLY.collect()


def round_digits(value: float) -> float:
    """Round to four significant digits, which keeps the parameter file readable."""
    return float(f'{value:.4g}')


def vote_statistics(
    config: ChainConfig,
    votes: Sequence[Vote],
    tracks: Sequence[Track],
    evaluation: EvaluationConfig | None = None,
    settling_rows: int = 0,
) -> list[VoteStatistics]:
    """Run a chain once over recordings; return the statistics of each vote.

    Parameters
    ----------
    config
        The chain, whose own threshold and vote are not used.
    votes, tracks
        The votes and the recordings.
    evaluation
        What counts as detected; None: the defaults.
    settling_rows
        Number of rows for which the chain settles, see :func:`.filters.settling_rows`.
    """
    # The threshold is a power of two that evidence can reach, which is multiplied back without
    # rounding. The chain's own decision is not used, so it has the fastest vote.
    unit = 2.0 ** (math.floor(math.log2(config.evidence_limit_db_s)) - 1)
    chain = SlipChain(dataclasses.replace(config, vote='all', threshold=unit))
    scoring, parts = evaluation or EvaluationConfig(), []
    for track in tracks:
        out = np.empty((len(votes), len(track.volts)))
        for begin, end in track.stretches:
            chain.restart() if begin else chain.reset()
            for start in range(begin, end, ROWS_PER_CALL):
                rows = slice(start, min(start + ROWS_PER_CALL, end))
                volts = track.volts[rows]
                result = chain.update(volts, envelope=False, level=False, votes=tuple(votes))
                np.multiply(result.vote_statistic.T, unit, out=out[:, rows])
        known = track.sample_rate_hz, track.samples.accuracy_s, track.kind
        scored = ScoredRows(track.slips, track.stretches, settling_rows, scoring, *known)
        parts.append((out, track, scored))
    return [
        VoteStatistics(
            dataclasses.replace(config, vote=vote), [(out[k], *known) for out, *known in parts]
        )
        for k, vote in enumerate(votes)
    ]
