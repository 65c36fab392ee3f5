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

"""Tremor of the hand: it changes the normal force and the position of the surface."""

import dataclasses

import numpy as np

from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet
from slip_detector.scenes.sines import NO_SINES, Sines

#: Number of parts, of equal frequency ratio, of the band of a tremor; each has a pair of sines.
TREMOR_PAIRS = 3

#: Amplitude ratio of the second sine of a pair to the first; their sum beats.
TREMOR_BEAT = 0.5

#: Upper bound of the ratio of a tremor's peak to its RMS.
TREMOR_PEAK = 4.0


@dataclasses.dataclass(frozen=True)
class Tremor(ParameterSet):
    """Tremor of the hand and motion of the arm.

    The default force is about the tremor of healthy fingers in a pinch: the background power in
    Table 1 of https://www.hindawi.com/journals/cmmm/2012/975735/ is up to 50 mN^2, which is 7 mN.
    The default motion is so small that the skin follows it and nothing slides.

    Examples
    --------
    >>> Tremor(force_rms_n=0.02).high_hz
    20.0
    """

    low_hz: float = parameter(2.0, 'Lowest frequency.', unit='Hz', low=0.01, high=1e3)
    high_hz: float = parameter(20.0, 'Highest frequency.', unit='Hz', low=0.01, high=1e3)
    force_rms_n: float = parameter(
        0.01, 'RMS of the force that is added to the normal force.', unit='N', low=0.0, high=100.0
    )
    motion_rms_m: float = parameter(
        5e-6, 'RMS of the motion of the surface along x.', unit='m', low=0.0, high=0.1
    )

    def __post_init__(self) -> None:
        """Check that the band is not empty."""
        super().__post_init__()
        if self.low_hz >= self.high_hz:
            raise ValueError(
                f'parameter high_hz is {self.high_hz:g} Hz, allowed: above low_hz, '
                f'{self.low_hz:g} Hz'
            )


class HandMotion:
    """The tremor of one trial: six sines for the normal force, six others for the position.

    The band has three parts of equal frequency ratio; in each of them two neighbouring sines beat
    slowly. All frequencies are within the band, and the long-term RMS is the configured one.

    Parameters
    ----------
    tremor
        The properties of the tremor.
    trial
        Generator of the trial. Force and motion always get a child of it each, in this order;
        nothing is drawn if the RMS is zero.

    Attributes
    ----------
    force_sines, motion_sines : Sines
        In newtons and metres; empty if the RMS is zero.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.scenes.tremor import HandMotion, Tremor
    >>> hand = HandMotion(Tremor(force_rms_n=0.3, motion_rms_m=0.0), np.random.default_rng(0))
    >>> float(np.sqrt(np.sum(hand.force_sines.amplitude**2) / 2).round(6))
    0.3
    >>> len(hand.motion_sines.amplitude)
    0
    """

    def __init__(self, tremor: Tremor, trial: np.random.Generator) -> None:
        of_force, of_motion = trial.spawn(2)
        self.force_sines = _tremor_sines(tremor, tremor.force_rms_n, of_force)
        self.motion_sines = _tremor_sines(tremor, tremor.motion_rms_m, of_motion)


def _tremor_sines(tremor: Tremor, rms: float, trial: np.random.Generator) -> Sines:
    if not rms:
        return NO_SINES
    # Places on the logarithmic scale from low_hz (0) to high_hz (1), not at the edges.
    first = np.arange(TREMOR_PAIRS) + trial.uniform(0.05, 0.85, TREMOR_PAIRS)
    second = first + trial.uniform(0.02, 0.1, TREMOR_PAIRS)
    places = np.concatenate([first, second]) / TREMOR_PAIRS
    frequency_hz = tremor.low_hz * (tremor.high_hz / tremor.low_hz) ** places
    relative = np.repeat([1.0, TREMOR_BEAT], TREMOR_PAIRS)
    amplitude = relative * rms / np.sqrt(np.sum(np.square(relative)) / 2)
    phase_rad = trial.uniform(0.0, 2 * np.pi, len(places))
    return Sines(amplitude, 2 * np.pi * frequency_hz, phase_rad)
