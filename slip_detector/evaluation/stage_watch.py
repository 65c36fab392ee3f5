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

"""Divides the latency of a detection into the parts of filter, envelope, decision and vote.

The filtered signal comes from a second chain with windows of one sample: its envelope is the
rectified signal raised to the exponent. This chain copies the state of the filters where a slip
begins and runs only until the alarm, so the algorithm is written once and few rows run twice.

Filtered signal and envelope are compared with the threshold; where evidence decides, with the
channel's noise floor plus ``evidence_offset_db``, above which evidence grows.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.result import SlipResult
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.events import STAGES
from slip_detector.parameters.detector import ChainConfig

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

#: Takes the place of a row that has not come.
NEVER = np.iinfo(np.int64).max


class StageWatch:
    """Measures how long each stage takes from the start of a slip to its alarm.

    Parameters
    ----------
    config
        Parameters of the chain that is watched.

    Attributes
    ----------
    watching : bool
        Whether a slip is being followed, which needs the chain's envelope. :meth:`begin` sets
        it; the caller clears it at the end.
    """

    def __init__(self, config: ChainConfig) -> None:
        one_sample_s = 1.0 / config.sample_rate_hz
        self._filters = SlipChain(
            dataclasses.replace(
                config,
                envelope_window_s=one_sample_s,
                decision_window_s=one_sample_s,
                decision='mean',
            )
        )
        self._members = [np.array(members) - 1 for members in config.groups.values()]
        self._threshold, self._offset_db = config.threshold, config.evidence_offset_db
        self._evidence = config.decision == 'evidence'
        self.watching = False

    def begin(self, chain: SlipChain, row: int) -> None:
        """Start at a slip, before the chain receives its first row.

        Parameters
        ----------
        chain
            The chain that is watched; its global decision is OFF.
        row
            Number of the first row of the slip.
        """
        # The first row above the threshold, for each of the first three stages and each channel.
        self._first = np.full((3, chain.config.channels), NEVER)
        self._start, self._alarm = row, NEVER
        self._filters.take_filters(chain)
        self.watching = True

    def follow(self, volts: Floats, result: SlipResult, row: int, rise: int | None) -> None:
        """Take the next rows while watching.

        Parameters
        ----------
        volts : ndarray, shape (n, c)
            At least one row.
        result
            The chain's result for these rows, with the envelope, and with evidence the floor.
        row
            Number of the first of these rows.
        rise
            Index of the row at which the global decision rises; None where it does not.
        """
        n = len(volts) if rise is None else rise + 1
        filtered = self._filters.update(volts[:n], level=False).envelope
        valid = result.valid[:n]
        least: Floats | float = self._threshold
        if self._evidence:
            least = 10.0 ** ((result.floor[:n] + self._offset_db) / 20.0)
        passed = (
            valid & (filtered > least),
            valid & (result.envelope[:n] > least),
            valid & result.channels[:n],
        )
        for first, through in zip(self._first, passed, strict=True):
            new = through.any(axis=0) & (first == NEVER)
            first[new] = row + through.argmax(axis=0)[new]
        if rise is not None:
            self._alarm = row + rise
            self._deciding = self._members[int(result.groups[rise].argmax())]

    def stages(self) -> dict[str, int] | None:
        """Return the rows spent in each stage, from slip to alarm; None without an alarm."""
        if self._alarm == NEVER:
            return None
        # A later stage may be above the threshold before the one that feeds it, as the windows
        # still hold rows from before the slip. Then the earlier stage ends at the same row.
        ends = [*self._first[:, self._deciding].min(axis=1).tolist(), self._alarm]
        for k in (2, 1, 0):
            ends[k] = min(ends[k], ends[k + 1])
        starts = [self._start, *ends]
        return {stage: ends[k] - starts[k] for k, stage in enumerate(STAGES)}

    def lost_at(self) -> str:
        """Return the first stage at which no channel was above the threshold, or the vote."""
        for stage, first in zip(STAGES, self._first, strict=False):
            if (first == NEVER).all():
                return stage
        return STAGES[-1]
