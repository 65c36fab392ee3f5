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

"""The electronics of the 16 channels, from loads to samples, with noise and faults."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from slip_detector.chain.samples import Floats
from slip_detector.parameters import PAPER_CHANNELS, PAPER_GROUPS, ParameterSet, parameter
from slip_detector.scenes.disturbances import NO_SINES, sines_at

#: Distance between the centres of two neighbouring sensors: 16 units on 22.3 mm2 (the density
#: published for this fingertip) are four sensors in cells of 2.36 mm x 2.36 mm.
SENSOR_PITCH_M = 2.36e-3

#: Distance of a unit from the centre of its sensor: half of the 1.4 mm die, less its frame.
UNIT_RADIUS_M = 0.5e-3

#: Which channels have units that sense shear across the finger; the others sense it along.
ACROSS = np.isin(np.arange(1, PAPER_CHANNELS + 1), PAPER_GROUPS['TP'] + PAPER_GROUPS['TD'])


def taxel_positions() -> Floats:
    """Return the positions of the 16 taxels, shape (16, 2), in metres from the tip's centre.

    x points across the finger to the radial side, y along the finger to the tip; the platform
    moves along x. The fingertip has a 2 x 2 array of MEMS sensors, each with four piezoresistive
    units at the ends of a cross. The publications give the numbers of the channels, the groups of
    Table 1 and the density of the units; the rest is inferred. Channels 1-4 belong to the distal
    ulnar sensor, 5-8 to the distal radial, 9-12 to the proximal radial and 13-16 to the proximal
    ulnar one: with no other assignment does every group of Table 1 have units of two neighbouring
    sensors. In each sensor the two units of one arm of the cross have odd numbers, those of the
    other arm even numbers.
    """
    half = SENSOR_PITCH_M / 2
    centres = [(-half, half), (half, half), (half, -half), (-half, -half)]
    positions = np.repeat(centres, 4, axis=0)
    from_centre_m = np.tile([-UNIT_RADIUS_M, -UNIT_RADIUS_M, UNIT_RADIUS_M, UNIT_RADIUS_M], 4)
    positions[np.arange(PAPER_CHANNELS), np.where(ACROSS, 0, 1)] += from_centre_m
    return positions


#: Time constant of the mean square of the activity that contact noise follows.
ACTIVITY_S = 0.05


#: Force from which on a contact makes all its noise; below, it is proportional to the force.
CONTACT_N = 0.01


class Electronics(ParameterSet):
    """The electronics of one fingertip; a seed determines the differences between the channels."""

    fingertip_seed: int = parameter(
        1, 'Seed of the differences between channels: one seed is one fingertip.', (0, 2**31 - 1)
    )
    baseline_v: tuple[float, float] = parameter(
        (4.3, 4.35), 'Range of the voltages without contact.', (-100.0, 100.0, 'V')
    )
    normal_v_n: float = parameter(-10.0, 'Sensitivity to normal load.', (-1e6, 1e6, 'V/N'))
    shear_v_n: float = parameter(
        2.2, 'Sensitivity to shear load of units across it (groups T).', (-1e6, 1e6, 'V/N')
    )
    shear_along_share: float = parameter(
        0.5, 'Share of shear_v_n that units along the finger (groups L) have.', (0.0, 1.0)
    )
    spread: float = parameter(
        0.1, 'Standard deviation of the sensitivities, as a share of them.', (0.0, 1.0)
    )
    bandwidth_hz: float = parameter(
        0.0, 'Corner of the first-order low-pass before the converter; 0: none.', (0.0, 1e9, 'Hz')
    )
    drift_v: float = parameter(
        0.0, 'Random walk of each baseline: deviation after one second.', (0.0, 100.0, 'V/sqrt(s)')
    )
    noise_v: float = parameter(
        0.5e-3, 'Standard deviation of the noise of a sample.', (0.0, 100.0, 'V')
    )
    rails_v: tuple[float, float] = parameter(
        (0.0, 5.0), 'Lowest and highest voltage.', (-1000.0, 1000.0, 'V'), rising=True
    )
    adc_bits: int = parameter(
        0, 'Resolution over the range of rails_v; 0: no quantisation.', (0, 32)
    )


class ContactNoise(ParameterSet):
    """White noise of the contact; it grows with the motion of the load at low frequencies."""

    noise_v: float = parameter(
        1.15e-3, 'Standard deviation of its noise while the load is still.', (0.0, 100.0, 'V')
    )
    band_hz: tuple[float, float] = parameter(
        (8.0, 20.0), 'Band of the activity of a channel.', (0.01, 1e6, 'Hz'), rising=True
    )
    knee_v: float = parameter(
        2.2e-3, 'RMS of the activity from which the noise grows.', (1e-9, 1e3, 'V')
    )
    growth: float = parameter(0.65, 'Decibels of noise for each of activity above.', (0.0, 2.0))


class ContactHiss:
    """The noise of a contact in one trial."""

    def __init__(self, part: ContactNoise, trial: np.random.Generator, rate_hz: float) -> None:
        from scipy import signal  # takes a while, and few scenes need it

        self._part, self._trial, self._run = part, trial, signal.sosfilt
        decay = math.exp(-1.0 / (ACTIVITY_S * rate_hz))
        mean = [[1.0 - decay, 0.0, 0.0, 1.0, -decay, 0.0]]
        band = signal.butter(2, part.band_hz, 'bandpass', fs=rate_hz, output='sos')
        self._filters = [(sos, np.zeros((len(sos), 2, PAPER_CHANNELS))) for sos in (band, mean)]

    def sample(self, clean_v: Floats, force_n: Floats) -> Floats:
        """Return the noise of the next rows, at least one."""
        (band, band_state), (mean, mean_state) = self._filters
        low_v, band_state[:] = self._run(band, clean_v, axis=0, zi=band_state)
        power, mean_state[:] = self._run(mean, low_v**2, axis=0, zi=mean_state)
        above = np.maximum(power / self._part.knee_v**2, 1.0)
        noise_v: Floats = self._trial.standard_normal(clean_v.shape)
        noise_v *= self._part.noise_v * above ** (self._part.growth / 2)
        noise_v *= np.minimum(force_n / CONTACT_N, 1.0)[:, np.newaxis]
        return noise_v


class Faults(ParameterSet):
    """Channels that fail."""

    from_s: float = parameter(0.0, 'Time at which the channels fail.', (0.0, 1e6, 's'))
    dead_channels: tuple[int, ...] = parameter(
        (), 'Channels that read the lower of rails_v.', (1, PAPER_CHANNELS)
    )


class Frontend:
    """The electronics of one trial: makes samples of clean volts, with hum, noise and faults.

    The voltage of a taxel is ``baseline_v + normal_v_n * normal load + shear_v_n * shear load``.
    Nothing is drawn or computed for a property that is zero. Each property draws from its own
    generator, so that no property changes the draws of another.
    """

    def __init__(
        self, parts: Mapping[str, Any], trials: Mapping[str, Any], rate_hz: float
    ) -> None:
        self._electronics: Electronics = parts['electronics']
        self._rate_hz = rate_hz
        fingertip = np.random.default_rng(self._electronics.fingertip_seed)
        low_v, high_v = sorted(self._electronics.baseline_v)
        self.baseline_v: Floats = fingertip.uniform(low_v, high_v, PAPER_CHANNELS)
        varied = 1 + self._electronics.spread * fingertip.standard_normal((2, PAPER_CHANNELS))
        shear_shares = np.where(ACROSS, 1.0, self._electronics.shear_along_share)
        self.normal_v_n: Floats = self._electronics.normal_v_n * varied[0]
        self.shear_v_n: Floats = self._electronics.shear_v_n * shear_shares * varied[1]
        self._drift_steps, self._sample_noise = trials['electronics'].spawn(2)
        self._wandered_v = np.zeros(PAPER_CHANNELS)
        self._hum = parts['hum'].sines(trials['hum']) if 'hum' in parts else NO_SINES
        self._faults: Faults = parts.get('faults', Faults())
        self._dead = np.array(self._faults.dead_channels, np.intp) - 1
        noise: ContactNoise | None = parts.get('contact_noise')
        self._hiss = ContactHiss(noise, trials['contact_noise'], rate_hz) if noise else None

    def sample(self, clean_v: Floats, time_s: Floats, force_n: Floats) -> Floats:
        """Sample the next rows of clean volts, shape (n, 16), under a normal force.

        Any cut of the rows into calls gives the same bits.
        """
        electronics = self._electronics
        volts = clean_v + self.baseline_v
        if self._hiss and len(volts):
            volts += self._hiss.sample(clean_v, force_n)
        if self._hum.size:
            volts += sines_at(time_s, self._hum)[:, np.newaxis]
        if electronics.drift_v and len(volts):
            steps_v = self._drift_steps.standard_normal(volts.shape)
            steps_v *= electronics.drift_v * np.sqrt(1.0 / self._rate_hz)
            steps_v[0] += self._wandered_v
            wandered_v = np.cumsum(steps_v, axis=0)
            self._wandered_v = wandered_v[-1].copy()
            volts += wandered_v
        if electronics.noise_v:
            volts += electronics.noise_v * self._sample_noise.standard_normal(volts.shape)
        low_v, high_v = electronics.rails_v
        volts = np.clip(volts, low_v, high_v)
        if electronics.adc_bits:
            top_code = 2**electronics.adc_bits - 1
            share = np.rint((volts - low_v) / (high_v - low_v) * top_code) / top_code
            # This form gives both rails exactly; the clip catches round-off if they nearly agree.
            volts = np.clip(low_v * (1.0 - share) + high_v * share, low_v, high_v)
        failed = np.flatnonzero(time_s >= self._faults.from_s)
        volts[np.ix_(failed, self._dead)] = low_v  # One code of the converter, without noise.
        return volts
