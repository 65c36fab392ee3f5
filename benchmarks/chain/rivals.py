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

"""The rivals of the chain's precision: float32, polynomials and running sums."""

import warnings
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray
from scipy import signal

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig

Floats = NDArray[np.float64]
#: An array of float64 or float32.
Reals = NDArray[Any]


class ScipyChain:
    """The chain's stages as a user of SciPy and NumPy would write them: a rival.

    Parameters
    ----------
    config
        Configuration of the chain.
    form
        ``sections`` or ``polynomials``.
    dtype
        Type of all numbers: float64 or float32.
    running
        Whether windows are running sums; otherwise terms are only added, as in the chain.
    """

    def __init__(
        self, config: ChainConfig, form: str, dtype: DTypeLike, running: bool = False
    ) -> None:
        self._config, self._dtype, self._running = config, np.dtype(dtype), running
        rate, shape = config.sample_rate_hz, {'sections': 'sos', 'polynomials': 'ba'}[form]
        low, high = config.passband_hz
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')  # SciPy warns of badly conditioned polynomials
            filters = [
                signal.butter(
                    config.passband_degree // 2, [low, high], 'bandpass', output=shape, fs=rate
                )
            ]
            filters += [
                signal.ellip(
                    config.stopband_degree // 2, config.stopband_ripple_db,
                    config.stopband_attenuation_db, pair, 'bandstop', output=shape, fs=rate,
                )
                for pair in config.stopbands_hz
            ]  # fmt: skip
        if form == 'sections':
            filters[0][0, :3] *= config.gain
        else:
            filters[0] = (config.gain * filters[0][0], filters[0][1])
        channels = config.channels
        self._stages: list[tuple[Callable[..., Any], tuple[Reals, ...], Reals]] = []
        for one in filters:
            if form == 'sections':
                coefficients: tuple[Reals, ...] = (one.astype(self._dtype),)
                delays = np.zeros((len(one), 2, channels), self._dtype)
                self._stages.append((signal.sosfilt, coefficients, delays))
            else:
                coefficients = tuple(part.astype(self._dtype) for part in one)
                delays = np.zeros((len(one[1]) - 1, channels), self._dtype)
                self._stages.append((signal.lfilter, coefficients, delays))
        self._windows = [
            np.zeros((config.samples(seconds), channels), self._dtype)
            for seconds in (config.envelope_window_s, config.decision_window_s)
        ]
        self._sums = np.zeros((2, channels), self._dtype)
        self._first: Reals | None = None

    def is_stable(self) -> bool:
        """Return whether all poles of the stored coefficients are inside the unit circle."""
        for _, coefficients, _ in self._stages:
            sections = len(coefficients) == 1
            rows = coefficients[0][:, 3:] if sections else coefficients[1][None]
            if not all(is_stable(row) for row in rows):
                return False
        return True

    def update(self, volts: Floats) -> tuple[Reals, Reals]:
        """Take the next rows; return envelope and level.

        Parameters
        ----------
        volts : ndarray, shape (n, channels)
            As many rows as a whole number of windows; both windows must have the same length.
        """
        if self._first is None:
            self._first = volts[0].copy()
        signals = (volts - self._first).astype(self._dtype)
        for i, (function, coefficients, delays) in enumerate(self._stages):
            signals, after = function(*coefficients, signals, axis=0, zi=delays)
            self._stages[i] = function, coefficients, after
        if self._config.rectify == 'half':
            signals = np.maximum(signals, 0)
        power = np.square(signals)
        factor = power.copy()
        for _ in range(self._config.exponent - 1):
            power *= factor
        envelope = np.sqrt(self._means(power, 0))
        return envelope, self._means(envelope, 1)

    def _means(self, values: Reals, i: int) -> Reals:
        before = self._windows[i]
        window = len(before)
        joined = np.concatenate([before, values])
        self._windows[i] = joined[-window:]
        if self._running:
            change = values - joined[:-window]
            change[0] += self._sums[i]
            totals = np.cumsum(change, axis=0)
            self._sums[i] = totals[-1]
            return np.asarray(np.maximum(totals, 0) / self._dtype.type(window))
        stretches = joined.reshape(-1, window, values.shape[1])
        totals = np.cumsum(stretches[1:], axis=1)
        tails = np.cumsum(stretches[:-1, :0:-1], axis=1)[:, ::-1]
        totals[:, :-1] += tails
        return np.asarray(totals.reshape(values.shape) / self._dtype.type(window))


def is_stable(polynomial: Reals) -> bool:
    """Return whether all roots are inside the unit circle, by the test of Schur and Cohn.

    It is exact, while root finders have larger errors than the distance of such roots to the
    circle.

    Examples
    --------
    >>> is_stable(np.array([1.0, -0.5])), is_stable(np.array([1.0, -1.5]))
    (True, False)
    """
    values = [Fraction(float(value)) for value in polynomial]
    while len(values) > 1:
        share = values[-1] / values[0]
        if abs(share) >= 1:
            return False
        values = [a - share * b for a, b in zip(values[:-1], values[:0:-1], strict=True)]
    return True


class PackageChain:
    """The chain of the package, with the methods of :class:`ScipyChain`."""

    def __init__(self, config: ChainConfig) -> None:
        self._chain = SlipChain(config)

    def is_stable(self) -> bool:
        """Return True: the package refuses unstable designs."""
        return True

    def update(self, volts: Floats) -> tuple[Floats, Floats]:
        """Take the next rows; return envelope and level."""
        result = self._chain.update(volts)
        return result.envelope, result.level


Method = PackageChain | ScipyChain

#: The methods, by name.
METHODS: dict[str, Callable[[ChainConfig], Method]] = {
    'chain': PackageChain,
    'sections float64': lambda config: ScipyChain(config, 'sections', np.float64),
    'sections float32': lambda config: ScipyChain(config, 'sections', np.float32),
    'polynomials float64': lambda config: ScipyChain(config, 'polynomials', np.float64),
    'polynomials float32': lambda config: ScipyChain(config, 'polynomials', np.float32),
}

RUNNING_SUMS = 'running sums float64'

WITH_RUNNING_SUMS = METHODS | {
    RUNNING_SUMS: lambda config: ScipyChain(config, 'sections', np.float64, running=True)
}


def run(method: Method, samples: Floats, config: ChainConfig) -> tuple[Reals, Reals]:
    """Run a method over any number of rows; return envelope and level."""
    window = config.samples(config.envelope_window_s)
    filled = np.concatenate([samples, np.repeat(samples[-1:], -len(samples) % window, axis=0)])
    with np.errstate(all='ignore'):  # An overflow shows in the figures.
        envelope, level = method.update(filled)
    return envelope[: len(samples)], level[: len(samples)]
