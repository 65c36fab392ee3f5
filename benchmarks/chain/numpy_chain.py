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

"""The chain as a user of SciPy and NumPy would write it: a rival of its speed."""

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from slip_detector.chain.filters import design
from slip_detector.parameters.detector import ChainConfig

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class NumpyChain:
    """The chain as a user of SciPy and NumPy would write it, for whole blocks of rows.

    Like such scripts it does not check the samples, which the chain does in addition.

    Parameters
    ----------
    config
        Configuration of the chain.
    first_row
        Volts that the input is taken to have had before its first row.
    in_place
        Whether it avoids temporary arrays and NumPy's powers: faster, but harder to read.
    """

    def __init__(self, config: ChainConfig, first_row: Floats, in_place: bool = False) -> None:
        self._sections = design(config)
        self._delays = signal.sosfilt_zi(self._sections)[:, :, None] * first_row
        self._squares = np.zeros((config.samples(config.envelope_window_s), config.channels))
        self._envelopes = np.zeros((config.samples(config.decision_window_s), config.channels))
        self._threshold = config.threshold
        self._members = [np.array(members) - 1 for members in config.groups.values()]
        self._in_place = in_place

    def update(self, rows: Floats) -> tuple[Bools, Bools, Bools]:
        """Take the next rows; return the decisions: slip, groups, channels."""
        y, self._delays = signal.sosfilt(self._sections, rows, axis=0, zi=self._delays)
        if self._in_place:
            squares = y * y
            squares *= y
            squares *= squares
        else:
            squares = (np.abs(y) ** 3) ** 2
        means, self._squares = self._windowed_mean(squares, self._squares)
        envelope = np.sqrt(means, out=means if self._in_place else None)
        level, self._envelopes = self._windowed_mean(envelope, self._envelopes)
        on = level > self._threshold
        groups = np.stack([on[:, members].all(axis=1) for members in self._members], axis=1)
        return np.any(groups, axis=1), groups, np.asarray(on)

    def _windowed_mean(self, values: Floats, before: Floats) -> tuple[Floats, Floats]:
        """Return the means over the window and the values that the next block needs."""
        window = len(before)
        joined = np.concatenate([before, values])
        kept = joined[-window:].copy()
        sums = np.cumsum(joined, axis=0, out=joined if self._in_place else None)
        # Rounding errors may make the difference of two sums negative.
        if self._in_place:
            means = sums[window:] - sums[:-window]
            means *= 1.0 / window
            return np.maximum(means, 0.0, out=means), kept
        return np.maximum((sums[window:] - sums[:-window]) / window, 0.0), kept
