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

Part of :mod:`chain.reference`, written as plainly.
"""

import numpy as np
from scipy import signal


def filter_input(volts, ok, valid, common_mode):
    """Form what goes into the filters; NaN before a channel's first good sample.

    ``ok`` are the samples that are credible, ``valid`` those that take part in the common mode.
    """
    average = {'none': None, 'mean': np.mean, 'median': np.median}[common_mode]
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


def filter_sections(config):
    """Design the filters as one cascade of second-order sections, shape (sections, 6)."""
    low, high = config.passband_hz
    # A band filter has twice the degree of the prototype SciPy asks for; a high-pass hasn't.
    design = {'output': 'sos', 'fs': config.sample_rate_hz}
    if high == 0:
        passband = signal.butter(config.passband_degree, low, 'highpass', **design)
    else:
        passband = signal.butter(config.passband_degree // 2, [low, high], 'bandpass', **design)
    degree, ripple_db = config.stopband_degree // 2, config.stopband_ripple_db
    stopbands = [
        signal.ellip(
            degree, ripple_db, config.stopband_attenuation_db, list(edges), 'bandstop', **design
        )
        for edges in config.stopbands_hz
    ]
    return np.concatenate([passband, *stopbands])


def low_sections(config):
    """Design the band-pass of the low level."""
    return signal.butter(
        2, config.activity_band_hz, 'bandpass', output='sos', fs=config.sample_rate_hz
    )


def run_filter(x, ok, sections):
    """Filter every channel from its first good sample on; 0 before it."""
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
