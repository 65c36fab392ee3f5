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

"""The electronics of the 16 channels: from loads to volts."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from slip_detector.parameters.detector import PAPER_CHANNELS, PAPER_GROUPS
from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet

Floats = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Electronics(ParameterSet):
    """The electronics of one fingertip; a seed determines the differences between the channels.

    Examples
    --------
    >>> Electronics(adc_bits=12, rails_v=(0, 3.3)).rails_v
    (0.0, 3.3)
    """

    fingertip_seed: int = parameter(
        1, 'Seed of the differences between channels: one seed is one fingertip.', (0, None)
    )
    baseline_v: tuple[float, float] = parameter(
        (4.3, 4.35), 'Range of the voltages without contact.', (-100.0, 100.0, 'V')
    )
    normal_v_n: float = parameter(-10.0, 'Sensitivity to normal load.', (-1e6, 1e6, 'V/N'))
    normal_along_share: float = parameter(
        1.0,
        'Sensitivity of the units along the finger (groups L) to normal load, as a share of '
        'normal_v_n.',
        (0.0, 1.0),
    )
    shear_v_n: float = parameter(
        2.2,
        'Sensitivity to shear load of the units across the finger (groups T).',
        (-1e6, 1e6, 'V/N'),
    )
    shear_along_share: float = parameter(
        0.5,
        'Sensitivity of the units along the finger (groups L) to shear load, as a share of '
        'shear_v_n.',
        (0.0, 1.0),
    )
    spread: float = parameter(
        0.1, 'Standard deviation of the sensitivities, as a share of them.', (0.0, 1.0)
    )
    bandwidth_hz: float = parameter(
        0.0,
        'Corner of the first-order low-pass before the converter; 0: unlimited.',
        (0.0, 1e9, 'Hz'),
    )
    drift_v: float = parameter(
        0.0,
        'Random walk of each baseline: its standard deviation after one second.',
        (0.0, 100.0, 'V/sqrt(s)'),
    )
    noise_v: float = parameter(
        0.5e-3, 'Standard deviation of the noise of a sample.', (0.0, 100.0, 'V')
    )
    rails_v: tuple[float, float] = parameter(
        (0.0, 5.0), 'Lowest and highest voltage of the electronics.', (-1000.0, 1000.0, 'V')
    )
    adc_bits: int = parameter(
        0, 'Resolution over the range of rails_v; 0: no quantisation.', (0, 32)
    )

    def __post_init__(self) -> None:
        """Check that the ranges begin with their lower end."""
        super().__post_init__()
        low, high = self.baseline_v
        if low > high:
            raise ValueError(
                f'parameter baseline_v is [{low:g}, {high:g}] V, allowed: low not above high'
            )
        low, high = self.rails_v
        if low >= high:
            raise ValueError(
                f'parameter rails_v is [{low:g}, {high:g}] V, allowed: low below high'
            )


class Frontend:
    """The electronics of one fingertip, from loads in newtons to the volts of a sample.

    The voltage of a taxel is ``baseline_v + normal_v_n * normal load + shear_v_n * shear load``;
    :meth:`sample` adds drift, noise, rails and converter. Nothing is drawn or computed for a
    property that is zero.

    Parameters
    ----------
    electronics
        The properties of the electronics.
    noise
        Generator of the trial. The drift and the noise always get a child of it each, in this
        order, so that one does not change the draws of the other.

    Attributes
    ----------
    baseline_v, normal_v_n, shear_v_n : ndarray, shape (16,)
        Voltage without contact and sensitivities of each channel, drawn from the fingertip's
        own seed.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.scenes.electronics import Electronics, Frontend
    >>> frontend = Frontend(Electronics(adc_bits=8), np.random.default_rng(0))
    >>> volts = frontend.sample(np.full((3, 16), 4.3), sample_period_s=1 / 380)
    >>> np.unique(volts.round(4))  # 8 bits of 5 V
    array([4.2941])
    """

    def __init__(self, electronics: Electronics, noise: np.random.Generator) -> None:
        self._electronics = electronics
        of_fingertip = np.random.default_rng(electronics.fingertip_seed)
        self.baseline_v: Floats = of_fingertip.uniform(*electronics.baseline_v, PAPER_CHANNELS)
        varied = 1 + electronics.spread * of_fingertip.standard_normal((2, PAPER_CHANNELS))
        shares = np.repeat(
            [[electronics.normal_along_share], [electronics.shear_along_share]],
            PAPER_CHANNELS,
            axis=1,
        )
        shares[:, [channel - 1 for channel in PAPER_GROUPS['TP'] + PAPER_GROUPS['TD']]] = 1.0
        self.normal_v_n: Floats = electronics.normal_v_n * shares[0] * varied[0]
        self.shear_v_n: Floats = electronics.shear_v_n * shares[1] * varied[1]
        self._drift_steps, self._sample_noise = noise.spawn(2)
        self._wandered_v = np.zeros(PAPER_CHANNELS)

    def sample(self, clean_v: Floats, sample_period_s: float) -> Floats:
        """Sample clean voltages: add drift and noise, then apply rails and converter.

        Call it with consecutive rows: the drift continues from call to call. Any cut of the rows
        into calls gives the same bits.

        Parameters
        ----------
        clean_v : ndarray, shape (n, 16)
            Voltages after the low-pass, without drift and noise.
        sample_period_s
            Time from row to row. The drift begins one period before the first row.

        Returns
        -------
        ndarray, shape (n, 16)
            Volts, a new array.
        """
        electronics = self._electronics
        volts = clean_v
        if electronics.drift_v and len(clean_v):
            steps_v = self._drift_steps.standard_normal(clean_v.shape)
            steps_v *= electronics.drift_v * np.sqrt(sample_period_s)
            steps_v[0] += self._wandered_v
            wandered_v = np.cumsum(steps_v, axis=0)
            self._wandered_v = wandered_v[-1].copy()
            volts = volts + wandered_v
        if electronics.noise_v:
            noise_v = self._sample_noise.standard_normal(clean_v.shape)
            volts = volts + electronics.noise_v * noise_v
        low_v, high_v = electronics.rails_v
        volts = np.clip(volts, low_v, high_v)
        if electronics.adc_bits:
            top_code = 2**electronics.adc_bits - 1
            share = np.rint((volts - low_v) / (high_v - low_v) * top_code) / top_code
            # This form gives both rails exactly; the clip catches round-off if they nearly agree.
            volts = np.clip(low_v * (1.0 - share) + high_v * share, low_v, high_v)
        return np.asarray(volts, dtype=np.float64)
