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

"""The rivals of the chain: in SciPy and NumPy, in float32 and with polynomials."""

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from slip_detector.chain.filters import design
from slip_detector.chain.samples import Bools, Floats
from slip_detector.parameters import ChainConfig


class NumpyChain:
    """The chain as a user of SciPy and NumPy would write it, for whole blocks of rows.

    Like such scripts it does not check the samples, which the chain does in addition.
    ``first_row`` are the volts that the input is taken to have had before its first row.
    """

    def __init__(self, config: ChainConfig, first_row: Floats) -> None:
        self._sections = design(config)
        self._delays = signal.sosfilt_zi(self._sections)[:, :, None] * first_row
        self._squares = np.zeros((config.samples(config.envelope_window_s), config.channels))
        self._envelopes = np.zeros((config.samples(config.decision_window_s), config.channels))
        self._threshold = config.threshold
        self._members = [np.array(members) - 1 for members in config.groups.values()]

    def update(self, rows: Floats) -> Bools:
        """Take the next rows; return the decisions side by side: slip, groups, channels."""
        y, self._delays = signal.sosfilt(self._sections, rows, axis=0, zi=self._delays)
        means, self._squares = self._windowed_mean((np.abs(y) ** 3) ** 2, self._squares)
        level, self._envelopes = self._windowed_mean(np.sqrt(means), self._envelopes)
        on = level > self._threshold
        groups = np.stack([on[:, members].all(axis=1) for members in self._members], axis=1)
        return np.hstack([groups.any(axis=1, keepdims=True), groups, on])

    def _windowed_mean(self, values: Floats, before: Floats) -> tuple[Floats, Floats]:
        """Return the means over the window and the values that the next block needs."""
        window = len(before)
        joined = np.concatenate([before, values])
        sums = np.cumsum(joined, axis=0)
        # Rounding errors may make the difference of two sums negative.
        means = np.maximum((sums[window:] - sums[:-window]) / window, 0.0)
        return means, joined[-window:].copy()


def scipy_levels(config: ChainConfig, samples: Floats, form: str, dtype: Any) -> NDArray[Any]:
    """Return the levels of whole columns as SciPy computes them: a rival of the precision.

    Parameters
    ----------
    config
        Configuration of the chain.
    samples : ndarray, shape (n, channels)
        Volts.
    form, dtype
        Form of the filters, ``sos`` or ``ba``, and the type of all numbers.
    """
    rate = config.sample_rate_hz
    order = config.passband_degree // 2
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # SciPy warns of badly conditioned polynomials
        filters = [signal.butter(order, config.passband_hz, 'bandpass', output=form, fs=rate)]
        filters += [
            signal.ellip(
                config.stopband_degree // 2, config.stopband_ripple_db,
                config.stopband_attenuation_db, pair, 'bandstop', output=form, fs=rate,
            )
            for pair in config.stopbands_hz
        ]  # fmt: skip
    values = (samples - samples[0]).astype(dtype)
    with np.errstate(all='ignore'):  # An overflow shows in the figures.
        for one in filters:
            coefficients = np.asarray(one).astype(dtype)
            if form == 'sos':
                values = signal.sosfilt(coefficients, values, axis=0)
            else:
                values = signal.lfilter(*coefficients, values, axis=0)
        values = np.square((values * dtype(config.gain)) ** config.exponent)
        window = np.ones(config.samples(config.envelope_window_s), dtype)
        values = np.sqrt(signal.lfilter(window, dtype(1), values, axis=0) / dtype(window.size))
        window = np.ones(config.samples(config.decision_window_s), dtype)
        values = signal.lfilter(window, dtype(1), values, axis=0) / dtype(window.size)
    return np.asarray(values)
