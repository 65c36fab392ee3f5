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

"""The filters of the reference: what goes into them, their design and their run.

Part of :mod:`support.reference`, written as plainly.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import signal


def filter_input(
    volts: np.ndarray, ok: np.ndarray, valid: np.ndarray, common_mode: str
) -> np.ndarray:
    """Form what goes into the filters.

    Parameters
    ----------
    volts : numpy.ndarray
        Samples, shape (n, c).
    ok : numpy.ndarray
        Which samples are credible, shape (n, c).
    valid : numpy.ndarray
        Which samples take part in the common mode, shape (n, c).
    common_mode : {'none', 'mean', 'median'}
        What is taken off every channel's deviation.

    Returns
    -------
    numpy.ndarray
        Shape (n, c); NaN before a channel's first good sample, where nothing is filtered.

    Raises
    ------
    ValueError
        If `common_mode` is none of the three.
    """
    averages = {'none': None, 'mean': np.mean, 'median': np.median}
    if common_mode not in averages:
        raise ValueError(f'common_mode must be one of {list(averages)}: {common_mode!r}')
    average = averages[common_mode]

    n_rows, n_channels = volts.shape
    x = np.full(volts.shape, np.nan)
    origin = np.full(n_channels, np.nan)
    held = np.full(n_channels, np.nan)
    common = 0.0
    for row in range(n_rows):
        if average is None:
            good_input = volts[row]
        else:
            # Deviations, not volts: the channels rest at different voltages, so a channel
            # dropping out of the average of volts would look like a step to all others.
            started = ~np.isnan(origin)
            voters = valid[row] & started
            if voters.any():
                common = average(volts[row, voters] - origin[voters])
            # A channel that starts late is taken to have followed the others until now. Its
            # own deviation says nothing yet, so the average hears it from the next row on.
            starting = ok[row] & ~started
            origin[starting] = volts[row, starting] - common
            # Only ok samples may be touched; infinities elsewhere would raise warnings.
            good_input = np.full(n_channels, np.nan)
            good_input[ok[row]] = volts[row, ok[row]] - origin[ok[row]] - common

        # What is held is the filter's input, not the voltage: the common mode of the
        # other channels doesn't leak into a channel that has nothing to say.
        held = np.where(ok[row], good_input, held)
        x[row] = held
    return x


def filter_sections(
    sample_rate_hz: float,
    passband_hz: tuple[float, float],
    passband_degree: int,
    stopbands_hz: Sequence[tuple[float, float]],
    stopband_degree: int,
    stopband_ripple_db: float,
    stopband_attenuation_db: float,
) -> np.ndarray:
    """Design the filters as one cascade of second-order sections.

    Parameters
    ----------
    sample_rate_hz : float
        Rows per second.
    passband_hz : tuple of float
        Edges of the band-pass; an upper edge of 0 makes it a high-pass.
    passband_degree : int
        Degree of the finished pass-band filter.
    stopbands_hz : sequence of tuple of float
        Edges of each band-stop.
    stopband_degree : int
        Degree of each finished band-stop.
    stopband_ripple_db, stopband_attenuation_db : float
        Pass-band ripple and stop-band attenuation of each band-stop.

    Returns
    -------
    numpy.ndarray
        Shape (sections, 6).
    """
    low, high = passband_hz
    # A band filter has twice the degree of the prototype SciPy asks for; a high-pass hasn't.
    if high == 0:
        passband = signal.butter(passband_degree, low, 'highpass', output='sos', fs=sample_rate_hz)
    else:
        passband = signal.butter(
            passband_degree // 2, [low, high], 'bandpass', output='sos', fs=sample_rate_hz
        )
    stopbands = [
        signal.ellip(
            stopband_degree // 2,
            stopband_ripple_db,
            stopband_attenuation_db,
            list(edges),
            'bandstop',
            output='sos',
            fs=sample_rate_hz,
        )
        for edges in stopbands_hz
    ]
    return np.concatenate([passband, *stopbands])


def run_filter(x: np.ndarray, ok: np.ndarray, sections: np.ndarray) -> np.ndarray:
    """Filter every channel from its first good sample on.

    Parameters
    ----------
    x : numpy.ndarray
        Input of the filters, shape (n, c).
    ok : numpy.ndarray
        Which samples are credible, shape (n, c).
    sections : numpy.ndarray
        Second-order sections, shape (s, 6).

    Returns
    -------
    numpy.ndarray
        Shape (n, c); 0 before a channel's first good sample.
    """
    # State of a cascade that has seen a constant 1 for ever. Scaled by the first input, it
    # spares the channel the burst that its resting voltage would cause as a step.
    at_rest = signal.sosfilt_zi(sections)
    y = np.zeros(x.shape)
    for column in range(x.shape[1]):
        good_rows = np.flatnonzero(ok[:, column])
        if good_rows.size > 0:
            inputs = x[good_rows[0] :, column]
            outputs, _ = signal.sosfilt(sections, inputs, zi=at_rest * inputs[0])
            y[good_rows[0] :, column] = outputs
    return y
