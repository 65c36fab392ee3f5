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

"""The spectrum of the latest samples: the mean of several short spectra (Welch, 1967)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal

#: Length of a short spectrum, in seconds, which resolves half a hertz, ...
SEGMENT_S = 2.0

#: ... but at most so many rows; and how many half-overlapping ones are averaged.
MOST_ROWS, SEGMENTS = 4096, 5

#: Fewest rows that make a spectrum.
FEWEST_ROWS = 32

#: Least density, in V^2/Hz: a channel that repeats one value has a density of zero.
LEAST_V2_HZ = 1e-30


class Spectrum(NamedTuple):
    """The amplitude density of channels over frequency.

    Attributes
    ----------
    step_hz : float
        Distance from one frequency to the next; the first frequency is one step.
    density_db : ndarray of float32, shape (channels, frequencies)
        dB relative to 1 V/sqrt(Hz).

    Examples
    --------
    >>> Spectrum(0.5, np.zeros((2, 381), np.float32)).density_db.shape
    (2, 381)
    """

    step_hz: float
    density_db: NDArray[np.float32]


def spectrum(volts: NDArray[np.float64], sample_rate_hz: float) -> Spectrum | None:
    """Return the spectrum of the last seconds, or None if there are too few rows.

    A value that is not finite is replaced by the last finite one.

    Parameters
    ----------
    volts
        Shape (n, channels), the oldest row first.
    sample_rate_hz
        Rate of the rows.

    Examples
    --------
    A sine of 1 V at 40 Hz has a power of half a square volt.

    >>> seconds = np.arange(4000) / 400
    >>> found = spectrum(np.sin(2 * np.pi * 40 * seconds)[:, np.newaxis], 400.0)
    >>> round(float(found.step_hz * (1 + found.density_db[0].argmax())), 6)
    40.0
    >>> round(float(np.sum(10 ** (found.density_db[0] / 10)) * found.step_hz), 3)
    0.5
    """
    rows = min(round(SEGMENT_S * sample_rate_hz), MOST_ROWS)
    volts = np.asarray(volts, np.float64)[-rows * (SEGMENTS + 1) // 2 :]
    rows = min(rows, len(volts))
    if rows < FEWEST_ROWS:
        return None
    # The squared values of a broken sensor may overflow.
    with np.errstate(over='ignore', invalid='ignore'):
        frequencies_hz, power = signal.welch(
            _without_gaps(volts), sample_rate_hz, nperseg=rows, axis=0, detrend='linear'
        )
    density_db = 10.0 * np.log10(np.maximum(power[1:], LEAST_V2_HZ))
    return Spectrum(float(frequencies_hz[1]), density_db.T.astype(np.float32))


def _without_gaps(volts: NDArray[np.float64]) -> NDArray[np.float64]:
    known = np.isfinite(volts)
    if known.all():
        return volts
    row = np.where(known, np.arange(len(volts))[:, np.newaxis], -1)
    row = np.maximum.accumulate(row, axis=0)
    # Rows before the first finite value get that value; a channel without any gets 0.
    row = np.where(row < 0, known.argmax(axis=0), row)
    return np.nan_to_num(np.take_along_axis(volts, row, axis=0), posinf=0.0, neginf=0.0)
