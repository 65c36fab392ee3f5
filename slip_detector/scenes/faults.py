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

"""What goes wrong between sensor and computer: clock, faulty channels, lost samples.

The clock of the sensor.

Channels that fail: dead, flat or noisy.

Samples that are lost on the way from the sensor.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from slip_detector.parameters.detector import PAPER_CHANNELS
from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet


@dataclasses.dataclass(frozen=True)
class Clock(ParameterSet):
    """A sensor that does not take samples at its nominal rate.

    Examples
    --------
    >>> from slip_detector.scenes.faults import Clock
    >>> 380.0 * Clock(rate_ratio=1.01).rate_ratio  # samples per second, nominally 380
    383.8
    """

    rate_ratio: float = parameter(
        1.01, 'True rate of the samples over the nominal rate.', (0.1, 10.0)
    )


Floats = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Faults(ParameterSet):
    """Channels that fail.

    Examples
    --------
    >>> Faults(dead_channels=[3], flat_channels=[5], from_s=2).dead_channels
    (3,)
    """

    from_s: float = parameter(0.0, 'Time at which the channels fail.', (0.0, 1e6, 's'))
    dead_channels: tuple[int, ...] = parameter(
        (), 'Channels that read the lower of rails_v.', (1, PAPER_CHANNELS)
    )
    flat_channels: tuple[int, ...] = parameter(
        (), 'Channels that keep reading their first sample from that time on.', (1, PAPER_CHANNELS)
    )
    noisy_channels: tuple[int, ...] = parameter(
        (), 'Channels with more noise.', (1, PAPER_CHANNELS)
    )
    noise_v: float = parameter(
        0.05, 'Standard deviation of the additional noise of noisy_channels.', (0.0, 100.0, 'V')
    )

    def __post_init__(self) -> None:
        """Check that at least one channel fails, and each in one way only."""
        super().__post_init__()
        failing: set[int] = set()
        for name in ('dead_channels', 'flat_channels', 'noisy_channels'):
            for channel in getattr(self, name):
                if channel in failing:
                    raise ValueError(
                        f'parameter {name} has channel {channel}, which fails already, '
                        'allowed: one fault for a channel'
                    )
                failing.add(channel)
        if not failing:
            raise ValueError(
                'parameters dead_channels, flat_channels and noisy_channels are all empty, '
                'allowed: at least one channel'
            )


class FaultyChannels:
    """The faults of one trial, before and after the converter.

    A bad joint adds noise to the analog voltage, which rails and converter then limit and
    quantise: :meth:`before_converter`. A dead or a flat channel repeats one code without noise:
    :meth:`after_converter`.

    Parameters
    ----------
    faults
        Which channels fail, how and when.
    trial
        Generator of the noise.
    lowest_v
        Voltage of a dead channel: the lower rail.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.scenes.faults import Faults, FaultyChannels
    >>> dead = Faults(dead_channels=(2,), from_s=0.1)
    >>> channels = FaultyChannels(dead, np.random.default_rng(0), lowest_v=0.0)
    >>> volts = channels.after_converter(np.full((3, 16), 4.3), np.array([0.0, 0.1, 0.2]))
    >>> volts[:, :3]
    array([[4.3, 4.3, 4.3],
           [4.3, 0. , 4.3],
           [4.3, 0. , 4.3]])
    """

    def __init__(self, faults: Faults, trial: np.random.Generator, lowest_v: float) -> None:
        self._faults, self._noise, self._lowest_v = faults, trial, lowest_v
        self._dead = np.array(faults.dead_channels, dtype=int) - 1
        self._flat = np.array(faults.flat_channels, dtype=int) - 1
        self._noisy = np.array(faults.noisy_channels, dtype=int) - 1
        self._held_v: Floats | None = None

    def before_converter(self, clean_v: Floats, time_s: Floats) -> Floats:
        """Add the noise of the noisy channels; call it with consecutive rows.

        Parameters
        ----------
        clean_v : ndarray, shape (n, 16)
            Voltages without the additional noise.
        time_s : ndarray, shape (n,)
            When each row is sampled.

        Returns
        -------
        ndarray, shape (n, 16)
            A new array, or ``clean_v`` itself where nothing is added.
        """
        if not len(self._noisy) or not self._faults.noise_v:
            return clean_v
        failed = time_s >= self._faults.from_s
        noise = self._noise.standard_normal((np.count_nonzero(failed), len(self._noisy)))
        volts: Floats = clean_v.copy()
        volts[np.ix_(failed, self._noisy)] += self._faults.noise_v * noise
        return volts

    def after_converter(self, volts: Floats, time_s: Floats) -> Floats:
        """Overwrite the dead and the flat channels; call it with consecutive rows.

        Parameters
        ----------
        volts : ndarray, shape (n, 16)
            Samples of the converter.
        time_s : ndarray, shape (n,)
            When each row was sampled.

        Returns
        -------
        ndarray, shape (n, 16)
            A new array, or ``volts`` itself where nothing changes.
        """
        failed = time_s >= self._faults.from_s
        if not (len(self._dead) or len(self._flat)) or not np.any(failed):
            return volts
        if self._held_v is None:
            self._held_v = volts[np.argmax(failed), self._flat]
        result: Floats = volts.copy()
        result[np.ix_(failed, self._dead)] = self._lowest_v
        result[np.ix_(failed, self._flat)] = self._held_v
        return result


@dataclasses.dataclass(frozen=True)
class Drops(ParameterSet):
    """Samples that are lost on the way, one at a time or several in a row.

    Examples
    --------
    >>> Drops(share=0.01, burst_samples=3).burst_samples
    3.0
    >>> Drops(share=0.6)
    Traceback (most recent call last):
    ValueError: parameter share is 0.6, allowed: at most 0.5 with a burst_samples of 1, ...
    """

    share: float = parameter(0.01, 'Share of the samples that are lost.', (0.0, 0.99))
    burst_samples: float = parameter(
        1.0, 'Mean number of consecutive lost samples; 1: never two.', (1.0, 1e6)
    )

    def __post_init__(self) -> None:
        """Check that bursts of this length can make up the share."""
        super().__post_init__()
        most = self.burst_samples / (self.burst_samples + 1)
        if self.share > most:
            raise ValueError(
                f'parameter share is {self.share:g}, allowed: at most {most:g} with a '
                f'burst_samples of {self.burst_samples:g}, as a sample arrives between two bursts'
            )


class LossyLink:
    """The losses of one trial: a Markov chain of two states (Gilbert's model).

    Parameters
    ----------
    drops
        Share and length of the losses.
    trial
        Generator of the trial; one number is drawn for each sample.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.scenes.faults import Drops, LossyLink
    >>> link = LossyLink(Drops(share=0.25), np.random.default_rng(0))
    >>> float(link.kept(100_000).mean().round(2))
    0.75
    """

    def __init__(self, drops: Drops, trial: np.random.Generator) -> None:
        self._trial = trial
        self._goes_on = 1.0 - 1.0 / drops.burst_samples
        # With this probability the stationary share of the Markov chain is the wanted share.
        self._begins = drops.share / ((1.0 - drops.share) * drops.burst_samples)
        self._lost = False

    def kept(self, n: int) -> NDArray[np.bool_]:
        """Return whether each of the next ``n`` samples arrives, shape (n,)."""
        kept = np.ones(n, dtype=np.bool_)
        if self._begins:
            for i, draw in enumerate(self._trial.random(n).tolist()):
                self._lost = draw < (self._goes_on if self._lost else self._begins)
                kept[i] = not self._lost
        return kept
